//! The study `acceptance`: what a clinic measures before it relies on a surface-guidance system, through
//! the three pods under the ceiling and the tracker.
//!
//! What lies on the couch is known in closed form, and so is where the couch takes it (`subject`). Known
//! displacements (`known`), pods that boards have calibrated (`frame`), an hour of fading light and warming pods (`drift`), pods behind the linac's
//! head (`hidden`), bodies that do not determine all motions (`phantoms`), regions of interest of all
//! sizes (`region`), skin tones (`tones`), beam-hold (`hold`) and times (`latency`) are held against what
//! clinics tolerate, and stand beside what was published of commercial systems (`summary`).

mod answer;
mod drift;
mod frame;
mod hidden;
mod hold;
mod known;
mod latency;
mod phantoms;
mod published;
mod region;
mod subject;
mod summary;
mod tones;
mod words;

use super::clinic::binned;
use phasmid_core::error::Result;
use phasmid_profile::Profile;
use phasmid_report::lab::{Document, Folder, Rows, Settings, Study, Trial};

/// The study.
pub struct Acceptance;

/// What is scanned.
#[derive(Debug, Clone, Copy)]
struct Effort {
    /// Columns and rows of the pods' cameras, which see the same as the profile's.
    size_px: [u32; 2],
    /// Shifts in millimetres and turns in degrees, each along and about each axis; either way, or this
    /// way along one axis and that way along the next.
    both_ways: bool,
    shifts_mm: &'static [f64],
    turns_deg: &'static [f64],
    /// Poses of a board that each pod is calibrated by.
    board_poses: usize,
    /// Device times in seconds of scans while the light fades, and of pods that have warmed.
    hour_s: &'static [f64],
    heat_s: &'static [f64],
    /// Scans one after the other at the end of the hour, a second apart.
    repeats: usize,
    /// Gantry angles in degrees.
    gantry_deg: &'static [f64],
    /// By how much the radii of regions exceed the distance of the nearest skin, in millimetres, and
    /// poses that all of them are tracked at.
    beyond_mm: &'static [f64],
    region_poses: usize,
    /// Classes of Fitzpatrick's scale.
    tones: &'static [u8],
    /// Shares of a scan at which the couch jumps.
    jumps: &'static [f64],
    /// Different scans that are timed, and how often one of them is.
    timed_scans: usize,
    timed_rounds: usize,
}

impl Effort {
    fn of(settings: &Settings) -> Self {
        match settings.quick {
            true => Self {
                size_px: [320, 240],
                both_ways: false,
                shifts_mm: &[10.0],
                turns_deg: &[2.0],
                board_poses: 6,
                hour_s: &[0.0, 900.0, 3600.0],
                heat_s: &[0.0, 3600.0],
                repeats: 5,
                gantry_deg: &[40.0, 320.0],
                beyond_mm: &[10.0, 40.0, 160.0],
                region_poses: 2,
                tones: &[1, 6],
                jumps: &[0.6],
                timed_scans: 1,
                timed_rounds: 6,
            },
            false => Self {
                size_px: [640, 480],
                both_ways: true,
                shifts_mm: &[1.0, 5.0, 10.0, 20.0],
                turns_deg: &[0.5, 1.0, 2.0, 3.0],
                board_poses: 20,
                hour_s: &[
                    0.0, 1.0, 60.0, 300.0, 600.0, 1200.0, 1800.0, 2400.0, 3000.0, 3600.0,
                ],
                heat_s: &[0.0, 300.0, 600.0, 1200.0, 2400.0, 3600.0],
                repeats: 20,
                gantry_deg: &[
                    0.0, 20.0, 40.0, 60.0, 90.0, 135.0, 225.0, 270.0, 300.0, 320.0, 340.0,
                ],
                beyond_mm: &[5.0, 10.0, 20.0, 40.0, 80.0, 160.0],
                region_poses: 7,
                tones: &[1, 2, 3, 4, 5, 6],
                jumps: &[0.0, 0.1, 0.3, 0.5, 0.7, 0.9],
                timed_scans: 4,
                timed_rounds: 120,
            },
        }
    }

    /// Makes a pod's profile that of this effort.
    fn adapt(&self, profile: &mut Profile) {
        binned(profile, self.size_px);
    }
}

impl Study for Acceptance {
    fn name(&self) -> &'static str {
        "acceptance"
    }

    fn about(&self) -> &'static str {
        "What a clinic measures of a surface-guidance system before it relies on it."
    }

    fn columns(&self) -> &'static [&'static str] {
        &[
            "subject",
            "case",
            "motion",
            "by",
            "time_s",
            "gantry_deg",
            "error_lat_mm",
            "error_lng_mm",
            "error_vrt_mm",
            "error_pitch_deg",
            "error_roll_deg",
            "error_yaw_deg",
            "sd_lat_mm",
            "sd_lng_mm",
            "sd_vrt_mm",
            "sd_pitch_deg",
            "sd_roll_deg",
            "sd_yaw_deg",
            "surface_mm",
            "axis_deg",
            "points",
            "points_left",
            "points_right",
            "points_foot",
            "coverage",
            "area_cm2",
            "rms_mm",
            "modulation_dn",
            "noise_mm",
            "predicted_mm",
            "gross",
            "free",
            "warnings",
            "period_ms",
            "hold_ms",
            "device_ms",
            "look_ms",
            "fit_ms",
            "host_ms",
            "scan_ms",
            "lost",
        ]
    }

    fn parts(&self) -> &'static [&'static str] {
        &[
            "known", "frame", "drift", "hidden", "phantoms", "region", "tones", "hold", "latency",
        ]
    }

    fn trials(&self, settings: &Settings) -> Result<Vec<Trial>> {
        let all = [
            known::trials(settings),
            frame::trials(settings),
            drift::trials(settings),
            hidden::trials(settings),
            phantoms::trials(settings),
            region::trials(settings),
            tones::trials(settings),
            hold::trials(settings),
            latency::trials(settings),
        ];
        Ok(all.into_iter().flatten().collect())
    }

    fn document(&self, rows: &Rows, _: &Folder, settings: &Settings) -> Result<Document> {
        Ok(Document {
            title: "Acceptance of a surface-guidance system".to_owned(),
            sections: vec![
                summary::section(rows),
                known::section(rows),
                frame::section(rows),
                drift::section(rows),
                hidden::section(rows),
                phantoms::section(rows),
                region::section(rows),
                tones::section(rows),
                hold::section(rows),
                latency::section(rows, settings),
            ],
        })
    }
}
