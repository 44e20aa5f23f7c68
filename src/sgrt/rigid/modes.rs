//! Which motions the shape determines, and how precisely.
//!
//! A motion x (shift and turn) displaces the points of the region by sqrt(x^T M x) RMS, in
//! millimetres; the scan provides the information x^T H x about it. The six solutions of the
//! generalised eigenproblem `H x = lambda M x` depend neither on the choice of origin nor on the unit
//! of angle: a mode of unit displacement has the standard deviation 1 / sqrt(lambda) mm.
//!
//! Without noise a plane has three modes of zero information, a sphere three and a cylinder two. Errors
//! in the normals hide this: with normals uncertain by s rad, a tangential motion seems to move the
//! points along sloped normals, which adds false information: s^2 times the information that a head-on
//! surface would give. Four times this false information (twice the standard deviation) is subtracted
//! before a mode is accepted.

use nalgebra::{Matrix6, Vector6};

/// The modes, least determined first.
#[derive(Debug, Clone)]
pub(super) struct Modes {
    /// Shift (mm) and turn (rad) of each mode, scaled to move the region's points by 1 mm RMS.
    pub(super) motions: [Vector6<f64>; 6],
    /// Fisher information about each mode in 1/mm^2; includes the false information that noisy normals
    /// add.
    pub(super) information: [f64; 6],
}

/// Criteria for accepting a mode as determined.
#[derive(Debug, Clone, Copy)]
pub(super) struct Belief {
    /// Ratio of the variance to the inverse of the information.
    pub(super) inflation: f64,
    /// False information caused by uncertain normals, in 1/mm^2.
    pub(super) false_information: f64,
    /// Expected standard deviation, in millimetres, above which a mode is undetermined.
    pub(super) tolerance_mm: f64,
}

impl Modes {
    /// Computes the modes from information and metric; `None` if the points lie on a line, because a
    /// rotation about that line moves no point.
    pub(super) fn new(information: &Matrix6<f64>, metric: &Matrix6<f64>) -> Option<Self> {
        // Scale rotations by the points' spread; otherwise the factorisation loses precision.
        let lever = (metric.fixed_view::<3, 3>(3, 3).trace() / 2.0).sqrt();
        if !(lever > 0.0) {
            return None;
        }
        let mut scale = Matrix6::identity();
        for k in 3..6 {
            scale[(k, k)] = 1.0 / lever;
        }
        let factor = (scale * metric * scale).cholesky()?;
        let smallest = factor.l_dirty().diagonal().min();
        if smallest < 1e-4 {
            return None;
        }
        let inverse = scale * factor.l().transpose().try_inverse()?;
        let eigen = (inverse.transpose() * information * inverse).symmetric_eigen();
        let mut order: [usize; 6] = std::array::from_fn(|k| k);
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        Some(Self {
            motions: order.map(|k| inverse * eigen.eigenvectors.column(k)),
            information: order.map(|k| eigen.eigenvalues[k].max(0.0)),
        })
    }

    /// Expected standard deviation of mode `k`, as RMS displacement of the region's points in
    /// millimetres; infinite if its information does not exceed the false information.
    pub(super) fn deviation_mm(&self, k: usize, belief: &Belief) -> f64 {
        let known = self.information[k] - 4.0 * belief.false_information;
        if known > 0.0 {
            (belief.inflation / known).sqrt()
        } else {
            f64::INFINITY
        }
    }

    /// Number of undetermined modes; they come first.
    pub(super) fn free(&self, belief: &Belief) -> usize {
        (0..6)
            .take_while(|&k| self.deviation_mm(k, belief) > belief.tolerance_mm)
            .count()
    }

    /// The solution of minimum displacement, excluding the first `free` modes.
    pub(super) fn solve(&self, right: &Vector6<f64>, free: usize) -> Vector6<f64> {
        (free..6)
            .map(|k| self.motions[k] * (self.motions[k].dot(right) / self.information[k]))
            .sum()
    }

    /// Inverse of the information, restricted to the determined modes.
    pub(super) fn inverse(&self, free: usize) -> Matrix6<f64> {
        (free..6)
            .map(|k| self.motions[k] * self.motions[k].transpose() / self.information[k])
            .sum()
    }
}
