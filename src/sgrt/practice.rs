//! Default settings for tracking a chest, shared by the command line and the studies.

use super::fit::{FitOptions, MotionFit, SetUp};
use super::rigid::{RigidFit, Start};
use super::surface::Region;
use glam::{DMat3, DVec3};
use phasmid_geometry::Pose;

/// Number of points per scan that are fitted, of all pods together. More points add no information,
/// because errors of points a few millimetres apart are correlated.
pub const POINTS: usize = 5_000;
/// Extent of the tracked skin from the isocentre along and across the couch, to either side, in
/// millimetres.
const REACH_MM: f64 = 250.0;
/// Extent of the tracked skin below the isocentre, in millimetres; excludes the couch.
const BELOW_MM: f64 = 40.0;

/// Standard deviation of the pose, in millimetres and degrees, due to light scattered below the skin,
/// which residuals do not show: RMS over the axes of a still patient (`phasmid study acceptance`).
const SKIN_SHIFT_MM: f64 = 0.15;
const SKIN_TURN_DEG: f64 = 0.03;
/// Error of the tumour's position due to breathing that differs from planning, relative to the
/// tumour's distance from its planned position: RMS over fifteen patients (`phasmid study sgrt`).
const DAY_SHARE: f64 = 0.15;

impl RigidFit {
    /// Computes the standard deviations for a patient's skin: [`Self::deviations`] combined with
    /// the effect of subsurface scattering.
    pub fn total_deviations(&self) -> [f64; 6] {
        let [shift, turn] = [SKIN_SHIFT_MM, SKIN_TURN_DEG];
        let skin = [shift, shift, shift, turn, turn, turn];
        let noise = self.deviations();
        std::array::from_fn(|i| noise[i].hypot(skin[i]))
    }
}

impl MotionFit {
    /// Computes the covariance of the tumour's position in square millimetres: noise, subsurface
    /// scattering, and breathing that differs from planning. The contribution of breathing grows with
    /// the distance from the planned position, `planned_mm`; its variance is twice as large along the
    /// direction from that position as across.
    pub fn total_covariance(&self, planned_mm: DVec3) -> DMat3 {
        let way = DAY_SHARE * (self.tumour_mm - planned_mm);
        let day = DMat3::from_cols(way * way.x, way * way.y, way * way.z)
            + DMat3::from_diagonal(DVec3::splat(way.length_squared()));
        let skin = DMat3::from_diagonal(DVec3::splat(SKIN_SHIFT_MM.powi(2)));
        self.tumour_covariance + day * 0.25 + skin
    }
}

impl Region {
    /// Corners of the box that contains the skin around the isocentre, in millimetres.
    pub const CHEST: [DVec3; 2] = [
        DVec3::new(-REACH_MM, -REACH_MM, -BELOW_MM),
        DVec3::new(REACH_MM, REACH_MM, 4.0 * REACH_MM),
    ];

    /// Returns the region of skin around the isocentre, without the couch.
    pub fn chest() -> Self {
        let [lo, hi] = Self::CHEST;
        Self::Box { lo, hi }
    }
}

impl Start {
    /// Start of the search for a patient set up by hand, near the planned pose.
    pub const SET_UP: Self = Self::Within {
        around: Pose::IDENTITY,
        range_mm: 50.0,
    };
}

impl FitOptions {
    /// Returns the settings for a patient set up by hand: the pose is fitted together with the
    /// breathing.
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
