//! What is tracked of a chest as a rule, by the command line and by studies.

use super::fit::{FitOptions, SetUp};
use super::rigid::Start;
use super::surface::Region;
use crate::geometry::Pose;
use glam::DVec3;

/// Points of a scan that are fitted, of all pods together: more of them say nothing new, for their
/// errors go together over some millimetres.
pub const POINTS: usize = 5_000;
/// Pixels of each pod that are decoded at least: of larger images as few as leave so many.
pub const PIXELS: usize = 60_000;
/// How far from the isocentre skin is tracked, along the couch and across it, in millimetres,
const REACH_MM: f64 = 250.0;
/// and how far below it: the couch is no skin.
const BELOW_MM: f64 = 40.0;

impl Region {
    /// The corners of the box that holds the skin about the isocentre, in millimetres.
    pub const CHEST: [DVec3; 2] = [
        DVec3::new(-REACH_MM, -REACH_MM, -BELOW_MM),
        DVec3::new(REACH_MM, REACH_MM, 4.0 * REACH_MM),
    ];

    /// The skin about the isocentre, without the couch.
    pub fn chest() -> Self {
        let [lo, hi] = Self::CHEST;
        Self::Box { lo, hi }
    }
}

impl Start {
    /// A patient who was set up by hand, somewhere near the planned place.
    pub const SET_UP: Self = Self::Within {
        around: Pose::IDENTITY,
        range_mm: 50.0,
    };
}

impl FitOptions {
    /// Of a patient who was set up by hand: the pose is fitted beside the breathing.
    pub fn by_hand() -> Self {
        Self {
            set_up: Some(SetUp {
                shift_sd_mm: 5.0,
                turn_sd_deg: 2.0,
            }),
            ..Self::default()
        }
    }
}
