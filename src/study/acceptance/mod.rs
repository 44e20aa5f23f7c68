//! Study `acceptance`: the tests that a clinic makes before it relies on a surface-guidance system,
//! with the three ceiling pods and the tracker.
//!
//! The object on the couch and the couch's motion are known in closed form (`subject`). The parts are
//! known displacements (`known`), pods calibrated with boards (`frame`), an hour of fading light and
//! warming pods (`drift`), pods behind the linac's head (`hidden`), bodies that do not determine all
//! motions (`phantoms`), regions of interest of all sizes (`region`), skin tones (`tones`), beam hold
//! (`hold`) and times (`latency`). Results are compared with clinical tolerances and with published
//! results of commercial systems (`summary`).

mod answer;
mod drift;
mod effort;
mod frame;
mod hidden;
mod hold;
mod known;
mod latency;
mod phantoms;
mod region;
mod subject;
mod summary;
mod tones;

use phasmid_core::error::Result;
use phasmid_report::lab::{Folder, Rows, Section, Settings, Study, Trial};

/// The study.
pub struct Acceptance;

impl Study for Acceptance {
    fn name(&self) -> &'static str {
        "acceptance"
    }

    fn about(&self) -> &'static str {
        "The tests that a clinic makes before it relies on a surface-guidance system."
    }

    fn title(&self) -> &'static str {
        "Acceptance of a surface-guidance system"
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

    fn sections(&self, rows: &Rows, _: &Folder, settings: &Settings) -> Result<Vec<Section>> {
        Ok(vec![
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
        ])
    }
}
