//! One Gauss-Newton step.

use super::super::robust::Spread;
use super::super::surface::Reference;
use super::RigidOptions;
use super::modes::{Belief, Modes};
use super::rows::Row;
use super::sums::Sums;
use glam::DVec3;
use nalgebra::Vector6;
use phasmid_geometry::Pose;
use phasmid_geometry::rotation::{exp, orthonormal};

/// Maximum length of a step, in millimetres of RMS displacement; longer steps are shortened, because
/// the tangent planes are a poor approximation beyond it.
const LONGEST_STEP_MM: f64 = 40.0;
/// A shift and turn of the reference about the image of the isocentre.
pub(super) struct Step {
    motion: Vector6<f64>,
    /// RMS displacement of the points, in millimetres.
    pub(super) size_mm: f64,
    pub(super) free: usize,
    pub(super) modes: Modes,
    pub(super) sums: Sums,
    pub(super) scale: f64,
}

impl Step {
    pub(super) fn applied(&self, pose: &Pose) -> Pose {
        let m = &self.motion;
        let rotation = exp(DVec3::new(m[3], m[4], m[5])) * pose.rotation;
        Pose {
            // Products of many rotations accumulate rounding errors.
            rotation: orthonormal(rotation),
            translation_mm: pose.translation_mm + DVec3::new(m[0], m[1], m[2]),
        }
    }
}

/// Computes one step from rows, holding at least `least_free` modes fixed; `None` if there are too
/// few rows or they lie on a line.
pub(super) fn advance(
    rows: &[Row],
    pods: usize,
    spread: Spread,
    least_free: usize,
    reference: &Reference,
    options: &RigidOptions,
) -> Option<Step> {
    let mut sizes: Vec<f64> = rows
        .iter()
        .filter(|r| r.counts())
        .map(|r| r.whitened().abs())
        .collect();
    if sizes.len() < 6 {
        return None;
    }
    let scale = spread.scale(&mut sizes).max(1.0);
    let sums = Sums::of(rows, scale, pods);
    let metric = sums.metric();
    let modes = Modes::new(&sums.information(), &metric)?;
    let mut belief = belief(&sums, 0.0, reference, options);
    if spread == Spread::Wide {
        // Far from the solution, residuals are dominated by the pose error, not by noise.
        belief.inflation = 1.0;
    }
    let free = modes.free(&belief).max(least_free);
    let mut motion = modes.solve(&sums.right, free);
    let mut size_mm = motion.dot(&(metric * motion)).max(0.0).sqrt();
    if size_mm > LONGEST_STEP_MM {
        motion *= LONGEST_STEP_MM / size_mm;
        size_mm = LONGEST_STEP_MM;
    }
    Some(Step {
        motion,
        size_mm,
        free,
        modes,
        sums,
        scale,
    })
}

/// Criteria for accepting modes; `density` is the number of points per square millimetre.
pub(super) fn belief(
    sums: &Sums,
    density: f64,
    reference: &Reference,
    options: &RigidOptions,
) -> Belief {
    let alike = 1.0 + std::f64::consts::TAU * options.correlation_mm.powi(2) * density;
    Belief {
        inflation: sums.inflation.factor(6) * alike,
        false_information: sums.weight * reference.normal_sd_rad().powi(2),
        tolerance_mm: options.tolerance_mm,
    }
}
