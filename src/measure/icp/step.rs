//! One step: six unknowns by weighted least squares; undetermined directions are left unchanged.

use super::pairs::Pair;
use glam::DVec3;
use nalgebra::{Matrix6, Vector6};
use phasmid_geometry::Pose;
use phasmid_geometry::rotation::exp;

/// One linear least-squares step.
pub(super) struct Step {
    centre: DVec3,
    pub(super) spread: f64,
    /// Rotation vector in radians, then translation in millimetres.
    rotation: DVec3,
    translation: DVec3,
    pub(super) determined: usize,
    pub(super) condition: f64,
    /// RMS residual in millimetres.
    pub(super) rms: f64,
    /// RMS change of the residuals by the step, in millimetres.
    pub(super) effect: f64,
    /// Sum of the weights.
    weight: f64,
}

impl Step {
    /// Solves for one step from at least one pair with a positive weight. The step does not move along
    /// directions in which it is shorter than `min_sigmas` standard deviations, by the RMS residual.
    pub(super) fn solve(pairs: &[(Pair, f64)], free_below: f64, min_sigmas: f64) -> Self {
        let n: f64 = pairs.iter().map(|(_, w)| w).sum();
        let centre = pairs.iter().map(|(p, w)| p.point * *w).sum::<DVec3>() / n;
        let variance = pairs
            .iter()
            .map(|(p, w)| (p.point - centre).length_squared() * w)
            .sum::<f64>()
            / n;
        // Coincident points have no spread; use any length.
        let spread = if variance > 0.0 { variance.sqrt() } else { 1.0 };
        let (mut system, mut right, mut squares) = (Matrix6::zeros(), Vector6::zeros(), 0.0);
        let mut weighted_squares = 0.0;
        for (pair, weight) in pairs {
            let turn = ((pair.point - centre) / spread).cross(pair.normal);
            let [a, b, c] = turn.to_array();
            let [d, e, f] = pair.normal.to_array();
            let row = Vector6::new(a, b, c, d, e, f);
            system += row * row.transpose() * (weight / n);
            right -= row * (pair.residual * weight / n);
            squares += pair.residual * pair.residual;
            weighted_squares += pair.residual * pair.residual * weight / n;
        }
        let eigen = system.symmetric_eigen();
        let largest = eigen.eigenvalues.max();
        let (mut unknowns, mut determined, mut smallest) = (Vector6::zeros(), 0, largest);
        for (value, direction) in eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter())
        {
            if *value > free_below * largest {
                let along = direction.dot(&right);
                if n * along * along >= min_sigmas * min_sigmas * value * weighted_squares {
                    unknowns += direction * (along / value);
                }
                determined += 1;
                smallest = smallest.min(*value);
            }
        }
        let u = unknowns;
        Self {
            centre,
            spread,
            rotation: DVec3::new(u[0], u[1], u[2]) / spread,
            translation: DVec3::new(u[3], u[4], u[5]),
            determined,
            condition: (largest / smallest).sqrt(),
            rms: (squares / pairs.len() as f64).sqrt(),
            effect: u.dot(&right).max(0.0).sqrt(),
            weight: n,
        }
    }

    /// Approximate displacement of the points by the step, in millimetres.
    pub(super) fn size(&self) -> f64 {
        self.rotation.length() * self.spread + self.translation.length()
    }

    /// Length of the step in standard deviations of the estimated motion, if the residuals have the
    /// standard deviation `noise_mm` and are independent.
    ///
    /// The covariance of the estimate is `noise^2 (sum w a a^T)^-1` with rows a of the system, so
    /// the squared length of the step u is `u^T (sum w a a^T) u / noise^2`.
    pub(super) fn sigmas(&self, noise_mm: f64) -> f64 {
        self.effect * self.weight.sqrt() / noise_mm
    }

    /// Rotation angle in degrees.
    pub(super) fn degrees(&self) -> f64 {
        self.rotation.length().to_degrees()
    }

    /// Returns the step as a rigid motion.
    pub(super) fn motion(&self) -> Pose {
        let rotation = exp(self.rotation);
        Pose {
            rotation,
            translation_mm: self.centre + self.translation - rotation * self.centre,
        }
    }
}
