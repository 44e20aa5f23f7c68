//! What is tracked of a chest as a rule, by the command line and by studies.

use super::fit::{FitOptions, MotionFit, SetUp};
use super::rigid::{RigidFit, Start};
use super::surface::Region;
use glam::{DMat3, DVec3};
use phasmid_geometry::Pose;

/// Points of a scan that are fitted, of all pods together: more of them say nothing new, for their
/// errors go together over some millimetres.
pub const POINTS: usize = 5_000;
/// Pixels of each pod that are decoded at least: of larger images as few as leave so many.
pub const PIXELS: usize = 60_000;
/// How far from the isocentre skin is tracked, along the couch and across it, in millimetres,
const REACH_MM: f64 = 250.0;
/// and how far below it: the couch is no skin.
const BELOW_MM: f64 = 40.0;

/// Light goes into skin and comes out elsewhere, which no residual shows: what that does to a pose, RMS
/// over the axes of a still patient (`phasmid study acceptance`), in millimetres and degrees.
const SKIN_SHIFT_MM: f64 = 0.15;
const SKIN_TURN_DEG: f64 = 0.03;
/// The breathing of the day is not planning's: error of a tumour's place over its way from the planned
/// one, RMS over fifteen patients (`phasmid study sgrt`).
const DAY_SHARE: f64 = 0.15;

impl RigidFit {
    /// Standard deviations as [`Self::deviations`] has them, of a patient's skin: noise, and the light in
    /// the skin.
    pub fn total_deviations(&self) -> [f64; 6] {
        let [shift, turn] = [SKIN_SHIFT_MM, SKIN_TURN_DEG];
        let skin = [shift, shift, shift, turn, turn, turn];
        let noise = self.deviations();
        std::array::from_fn(|i| noise[i].hypot(skin[i]))
    }
}

impl MotionFit {
    /// Covariance of the tumour's place in square millimetres: noise, the light in the skin, and breathing
    /// that is not planning's, which grows with the way from the planned place, `planned_mm`, twice as much
    /// along it as across.
    pub fn total_covariance(&self, planned_mm: DVec3) -> DMat3 {
        let way = DAY_SHARE * (self.tumour_mm - planned_mm);
        let day = DMat3::from_cols(way * way.x, way * way.y, way * way.z)
            + DMat3::from_diagonal(DVec3::splat(way.length_squared()));
        let skin = DMat3::from_diagonal(DVec3::splat(SKIN_SHIFT_MM.powi(2)));
        self.tumour_covariance + day * 0.25 + skin
    }
}

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
