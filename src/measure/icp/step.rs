//! One step: six unknowns by least squares; undetermined directions are left unchanged.

use super::pairs::Pair;
use glam::{DMat3, DVec3};
use nalgebra::{Matrix6, Vector6};
use phasmid_geometry::Pose;

/// One linear least-squares step.
pub(super) struct Step {
    centre: DVec3,
    pub(super) spread: f64,
    /// Rotation vector in radians, then translation in millimetres.
    rotation: DVec3,
    translation: DVec3,
    pub(super) determined: usize,
    pub(super) condition: f64,
    pub(super) rms: f64,
}

impl Step {
    /// Solves for one step; `None` without pairs.
    pub(super) fn solve(pairs: &[Pair], free_below: f64) -> Option<Self> {
        if pairs.is_empty() {
            return None;
        }
        let n = pairs.len() as f64;
        let centre = pairs.iter().map(|p| p.point).sum::<DVec3>() / n;
        let variance = pairs
            .iter()
            .map(|p| (p.point - centre).length_squared())
            .sum::<f64>()
            / n;
        // A single point has no spread; use any length.
        let spread = if variance > 0.0 { variance.sqrt() } else { 1.0 };
        let (mut system, mut right, mut squares) = (Matrix6::zeros(), Vector6::zeros(), 0.0);
        for pair in pairs {
            let turn = ((pair.point - centre) / spread).cross(pair.normal);
            let [a, b, c] = turn.to_array();
            let [d, e, f] = pair.normal.to_array();
            let row = Vector6::new(a, b, c, d, e, f);
            system += row * row.transpose() / n;
            right -= row * (pair.residual / n);
            squares += pair.residual * pair.residual;
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
                unknowns += direction * (direction.dot(&right) / value);
                determined += 1;
                smallest = smallest.min(*value);
            }
        }
        let u = unknowns;
        Some(Self {
            centre,
            spread,
            rotation: DVec3::new(u[0], u[1], u[2]) / spread,
            translation: DVec3::new(u[3], u[4], u[5]),
            determined,
            condition: (largest / smallest).sqrt(),
            rms: (squares / n).sqrt(),
        })
    }

    /// Approximate displacement of the points by the step, in millimetres.
    pub(super) fn size(&self) -> f64 {
        self.rotation.length() * self.spread + self.translation.length()
    }

    /// Returns the step as a rigid motion.
    pub(super) fn motion(&self) -> Pose {
        let angle = self.rotation.length();
        let rotation = self
            .rotation
            .try_normalize()
            .map_or(DMat3::IDENTITY, |axis| DMat3::from_axis_angle(axis, angle));
        Pose {
            rotation,
            translation_mm: self.centre + self.translation - rotation * self.centre,
        }
    }
}

/// Removes rounding errors from a rotation matrix (Gram-Schmidt).
pub(super) fn orthonormal(m: DMat3) -> DMat3 {
    let x = m.x_axis.normalize();
    let y = (m.y_axis - x * x.dot(m.y_axis)).normalize();
    DMat3::from_cols(x, y, x.cross(y))
}
