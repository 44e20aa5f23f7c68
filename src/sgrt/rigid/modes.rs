//! Which motions the shape determines, and how well.
//!
//! A motion x (shift and turn) moves the points of the region by sqrt(x^T M x) RMS, in millimetres,
//! and the scan knows it with the information x^T H x. The six stationary ratios of the two,
//! `H x = lambda M x`, do not depend on where the origin is nor on units of angle: a mode of unit
//! displacement is known to 1 / sqrt(lambda) mm. A plane has three modes of no information, a sphere
//! three, a cylinder two, but noise hides that: normals that are uncertain by s rad turn each slide
//! into a slope and give s^2 of the information that a head-on surface would give, all of it false.
//! Twice that deviation is taken off before a mode is believed.

use nalgebra::{Matrix6, Vector6};

/// The modes, the least determined first.
#[derive(Debug, Clone)]
pub(super) struct Modes {
    /// Shift (mm) and turn (rad) that move the region's points by 1 mm RMS.
    pub(super) motions: [Vector6<f64>; 6],
    /// Information of each in 1/mm^2, as the rows give it.
    pub(super) information: [f64; 6],
}

/// What decides whether a mode is believed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Belief {
    /// By how much the variance exceeds the inverse of the information.
    pub(super) inflation: f64,
    /// Information in 1/mm^2 that the uncertainty of normals feigns.
    pub(super) false_information: f64,
    /// Expected deviation from which a mode is not determined.
    pub(super) tolerance_mm: f64,
}

impl Modes {
    /// Of information and metric; `None` where points lie on a line, so that some turn moves none.
    pub(super) fn new(information: &Matrix6<f64>, metric: &Matrix6<f64>) -> Option<Self> {
        // Turns in units of the points' spread, or the factorisation loses digits.
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

    /// Expected RMS displacement of the region's points along mode `k`, in millimetres; infinite
    /// where nothing is known.
    pub(super) fn deviation_mm(&self, k: usize, belief: &Belief) -> f64 {
        let known = self.information[k] - 4.0 * belief.false_information;
        if known > 0.0 {
            (belief.inflation / known).sqrt()
        } else {
            f64::INFINITY
        }
    }

    /// How many modes, the first ones, are not determined.
    pub(super) fn free(&self, belief: &Belief) -> usize {
        (0..6)
            .take_while(|&k| self.deviation_mm(k, belief) > belief.tolerance_mm)
            .count()
    }

    /// The step of least displacement that solves the system but for the first `free` modes.
    pub(super) fn solve(&self, right: &Vector6<f64>, free: usize) -> Vector6<f64> {
        (free..6)
            .map(|k| self.motions[k] * (self.motions[k].dot(right) / self.information[k]))
            .sum()
    }

    /// Inverse of the information in the determined modes.
    pub(super) fn inverse(&self, free: usize) -> Matrix6<f64> {
        (free..6)
            .map(|k| self.motions[k] * self.motions[k].transpose() / self.information[k])
            .sum()
    }
}
