//! The tracked pose with its covariance and warnings.

use super::super::six::SixDof;
use super::super::surface::Reference;
use super::super::warning::{Lost, Warning};
use super::rows::Row;
use super::step::{Step, belief};
use super::{Freedom, RigidOptions};
use nalgebra::Matrix6;
use phasmid_geometry::Pose;

/// A tracked pose with its uncertainty.
#[derive(Debug, Clone)]
pub struct RigidFit {
    /// Maps reference coordinates to room coordinates.
    pub room_from_reference: Pose,
    /// The same pose as six numbers.
    pub six: SixDof,
    /// Covariance of the isocentre's position (mm) and of the rotation vector (rad), both along the
    /// room's axes. Undetermined motions have the standard deviation [`RigidOptions::range_mm`].
    pub covariance: Matrix6<f64>,
    /// Number of the six motions that are determined.
    pub determined: usize,
    /// Reasons to doubt the result; empty if there are none.
    pub warnings: Vec<Warning>,
    /// Number of points with non-zero weight.
    pub points: usize,
    /// Fraction of the region's area that is measured.
    pub coverage: f64,
    /// RMS distance of the points with non-zero weight to their tangent planes, in millimetres.
    pub rms_mm: f64,
    /// Scale of the residuals in units of their standard deviations.
    pub spread: f64,
    /// Number of steps taken.
    pub iterations: usize,
}

impl RigidFit {
    /// Returns the standard deviations of the six numbers, in the order of
    /// [`six::NAMES`](crate::six::NAMES), in millimetres and degrees.
    pub fn deviations(&self) -> [f64; 6] {
        self.six.deviations(&self.covariance)
    }
}

pub(super) fn lost(rows: &[Row], options: &RigidOptions) -> Lost {
    let found = rows.iter().filter(|r| r.counts()).count();
    if found >= options.least_points {
        return Lost::Line;
    }
    Lost::Points {
        found,
        wanted: options.least_points,
    }
}

/// Builds the result, with covariance and warnings, from the last step and its rows.
pub(super) fn judged(
    last: &Step,
    rows: &[Row],
    reference: &Reference,
    pose: &Pose,
    options: &RigidOptions,
) -> RigidFit {
    let sums = &last.sums;
    let used = rows.iter().filter(|r| r.counts()).map(|r| r.triangle);
    let covered = reference.covered_mm2(used);
    let density = sums.count as f64 / covered.max(1.0);
    let belief = belief(sums, density, reference, options);
    // Correlated noise raises the variance, so more modes can be undetermined than in the last step.
    let free = last.modes.free(&belief).max(last.free);
    let inverse = last.modes.inverse(free);
    let mut covariance = inverse * belief.inflation;
    if options.pod_sd_mm > 0.0 {
        for pod in &sums.pods {
            let gain = inverse * pod;
            covariance += gain * gain.transpose() * options.pod_sd_mm.powi(2);
        }
    }
    for motion in &last.modes.motions[..free] {
        covariance += motion * motion.transpose() * options.range_mm.powi(2);
    }
    let six = SixDof::of(pose);
    let mut warnings = Vec::new();
    if free > 0 {
        let middle = sums.levers / sums.count as f64;
        let metric = sums.metric();
        let spread = metric.fixed_view::<3, 3>(3, 3).trace() / 2.0 - middle.length_squared();
        let origin = pose.translation_mm;
        warnings.push(Warning::Undetermined {
            free: Freedom::of(
                &last.modes.motions[..free],
                origin,
                origin + middle,
                spread.max(0.0).sqrt(),
            ),
            deviation_mm: last.modes.deviation_mm(free - 1, &belief),
            tolerance_mm: options.tolerance_mm,
        });
    }
    if last.scale > options.misfit {
        warnings.push(Warning::Misfit { factor: last.scale });
    }
    let coverage = covered / reference.area_mm2();
    if coverage < options.least_coverage {
        warnings.push(Warning::Coverage { share: coverage });
    }
    RigidFit {
        room_from_reference: *pose,
        six,
        covariance,
        determined: 6 - free,
        warnings,
        points: sums.count,
        coverage,
        rms_mm: (sums.squares_mm2 / sums.shares).sqrt(),
        spread: last.scale,
        iterations: 0,
    }
}
