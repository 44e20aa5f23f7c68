//! The number of scans of the study, in its quick and its complete form.

use crate::clinic::binned;
use phasmid_profile::Profile;
use phasmid_report::lab::Settings;

/// Numbers of scans and parameters of all parts.
#[derive(Debug, Clone, Copy)]
pub(super) struct Effort {
    /// Columns and rows of the pods' cameras; the field of view is that of the profile.
    pub(super) size_px: [u32; 2],
    /// Whether shifts (mm) and turns (degrees) along and about each axis are made in both directions,
    /// or in alternating directions from axis to axis.
    pub(super) both_ways: bool,
    pub(super) shifts_mm: &'static [f64],
    pub(super) turns_deg: &'static [f64],
    /// Number of board poses in the calibration of each pod.
    pub(super) board_poses: usize,
    /// Device times in seconds: of scans while the light fades, then of scans with warmed pods.
    pub(super) hour_s: &'static [f64],
    pub(super) heat_s: &'static [f64],
    /// Number of scans at the end of the hour, one second apart.
    pub(super) repeats: usize,
    /// Gantry angles in degrees.
    pub(super) gantry_deg: &'static [f64],
    /// Radii of the regions minus the distance of the nearest skin, in millimetres; then the number of
    /// poses in which each region is tracked.
    pub(super) beyond_mm: &'static [f64],
    pub(super) region_poses: usize,
    /// Classes of Fitzpatrick's scale.
    pub(super) tones: &'static [u8],
    /// Fractions of a scan at which the couch jumps.
    pub(super) jumps: &'static [f64],
    /// Number of different scans that are timed, then the number of timed repetitions.
    pub(super) timed_scans: usize,
    pub(super) timed_rounds: usize,
}

impl Effort {
    pub(super) fn of(settings: &Settings) -> Self {
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

    /// Applies this effort to a pod's profile.
    pub(super) fn adapt(&self, profile: &mut Profile) {
        binned(profile, self.size_px);
    }
}
