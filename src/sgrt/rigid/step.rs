//! The settings of rigid tracking, and one Gauss-Newton step.

use super::super::robust::Spread;
use super::super::surface::Reference;
use super::modes::{Belief, Modes};
use super::rows::Row;
use super::sums::Sums;
use glam::DVec3;
use nalgebra::Vector6;
use phasmid_geometry::Pose;
use phasmid_geometry::rotation::{exp, orthonormal};

/// Settings of [`track_rigid`](super::track_rigid).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigidOptions {
    /// Maximum number of steps.
    pub max_iterations: usize,
    /// Convergence threshold: RMS displacement of the region's points in one step, in millimetres.
    pub step_mm: f64,
    /// Points farther from the surface than this are ignored, in millimetres.
    pub capture_mm: f64,
    /// A motion is undetermined if its expected standard deviation (RMS displacement of the region's
    /// points) exceeds this, in millimetres.
    pub tolerance_mm: f64,
    /// Standard deviation assigned to an undetermined motion, in millimetres.
    pub range_mm: f64,
    /// Correlation length l of the points' errors, in millimetres; 0 for white noise. With the
    /// correlation exp(-d^2 / 2 l^2), the mean over an area carries as much information as one point
    /// per 2 pi l^2, so variances grow by the factor 1 + 2 pi l^2 times the density of the points.
    pub correlation_mm: f64,
    /// Standard deviation along each axis, in millimetres, of the common offset of a pod's points
    /// that calibration leaves.
    pub pod_sd_mm: f64,
    /// Minimum number of points over the region; with fewer, tracking fails.
    pub least_points: usize,
    /// Fraction of the region's area that a scan should cover; below it the result has a warning.
    pub least_coverage: f64,
    /// Scale of the residuals, in units of their standard deviations, above which a misfit is
    /// reported.
    pub misfit: f64,
}

impl Default for RigidOptions {
    fn default() -> Self {
        Self {
            max_iterations: 40,
            step_mm: 5e-4,
            capture_mm: 60.0,
            tolerance_mm: 0.5,
            range_mm: 50.0,
            correlation_mm: 1.0,
            pod_sd_mm: 0.0,
            least_points: 60,
            least_coverage: 0.3,
            misfit: 3.0,
        }
    }
}

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
