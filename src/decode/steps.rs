//! Least squares over the N steps of fringes of one period; the steps may be unequal.
//!
//! Frame i shows I_i = A + C cos(theta_i) - S sin(theta_i) with C = B cos(phi), S = B sin(phi) and
//! phi = 2 pi x / period. (A, C, S) is the pseudo-inverse of the N x 3 matrix with rows [1,
//! cos(theta_i), -sin(theta_i)], applied to the samples (Greivenkamp, "Generalized data reduction for
//! heterodyne interferometry", Opt. Eng. 23(4), 1984). For N equal steps the standard deviation of
//! the phase is sqrt(2/N) sigma / B.

use nalgebra::{Matrix3, Vector3};
use phasmid_core::error::{Error, Result};
use phasmid_pattern::{Axis, Pattern};
use std::f64::consts::TAU;

/// Least-squares solution for one set of steps.
#[derive(Debug, Clone, PartialEq)]
pub struct FringeSet {
    /// Period in projector pixels.
    pub period_px: f64,
    /// Index of each step's frame in the sequence.
    pub frames: Vec<usize>,
    /// Phase of each step in radians.
    pub phases: Vec<f64>,
    /// Weights of the frames in A, C and S.
    pub weights: Vec<[f64; 3]>,
    /// Sums over the frames of wc wc, wc ws, ws ws: the covariance of (C, S) per unit variance.
    pub gram: [f64; 3],
    /// Contribution to the phase's variance of shot noise that follows the fringe: the coefficients of
    /// C^3, C^2 S, C S^2 and S^3.
    pub skew: [f64; 4],
    /// A unit vector over the frames, orthogonal to A, C and S: its product with a valid pixel's
    /// samples is noise plus the effect of a response curve. Empty if there are as many unknowns as
    /// steps.
    pub check: Vec<f64>,
}

impl FringeSet {
    /// Creates the least-squares solution of steps at `phases` (radians) in the frames `frames`;
    /// `place` names the set in messages.
    ///
    /// # Errors
    /// Returns an error if there are fewer than three steps, or if the steps do not separate A, C and
    /// S.
    pub fn new(place: &str, period_px: f64, frames: Vec<usize>, phases: Vec<f64>) -> Result<Self> {
        let n = phases.len();
        if n < 3 {
            return Err(Error::input(
                place,
                format!("{n} step{}", if n == 1 { "" } else { "s" }),
                "3 or more steps of different phase",
            ));
        }
        let rows: Vec<Vector3<f64>> = phases
            .iter()
            .map(|&t| t.rem_euclid(TAU))
            .map(|t| Vector3::new(1.0, t.cos(), -t.sin()))
            .collect();
        let normal: Matrix3<f64> = rows.iter().map(|r| r * r.transpose()).sum();
        let least = normal.symmetric_eigenvalues().min() / n as f64;
        let inverse = normal.try_inverse().filter(|_| least > 1e-6);
        let Some(inverse) = inverse else {
            let degrees: Vec<String> = phases
                .iter()
                .map(|t| format!("{:.4}", t.rem_euclid(TAU).to_degrees()))
                .collect();
            return Err(Error::input(
                place,
                format!("steps at {} degrees", degrees.join(", ")),
                "at least 3 different phases (modulo 360 degrees)",
            ));
        };
        let weights: Vec<[f64; 3]> = rows.iter().map(|r| (inverse * r).into()).collect();
        let mut gram = [0.0; 3];
        let mut skew = [0.0; 4];
        for (&[_, wc, ws], row) in weights.iter().zip(&rows) {
            let (cos, sin) = (row[1], -row[2]);
            gram[0] += wc * wc;
            gram[1] += wc * ws;
            gram[2] += ws * ws;
            // (C ws - S wc)^2 (C cos - S sin), expanded.
            skew[0] += ws * ws * cos;
            skew[1] -= ws * ws * sin + 2.0 * ws * wc * cos;
            skew[2] += 2.0 * ws * wc * sin + wc * wc * cos;
            skew[3] -= wc * wc * sin;
        }
        let check = check(&rows, &weights);
        Ok(Self {
            period_px,
            frames,
            phases,
            weights,
            gram,
            skew,
            check,
        })
    }

    /// Computes A, C and S of samples in the order of [`Self::frames`] in f64, as a reference
    /// implementation.
    pub fn solve(&self, samples: &[f64]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (w, &v) in self.weights.iter().zip(samples) {
            for k in 0..3 {
                sum[k] += w[k] * v;
            }
        }
        sum
    }

    /// Computes the RMS error in projector pixels of coordinates decoded from levels that the projector
    /// rounds to 8 bits.
    pub(super) fn rounding_px(&self) -> f64 {
        // A period need not be a whole number of pixels.
        const PIXELS: u32 = 256;
        let row = |&phase_rad: &f64| {
            let fringe = Pattern::Fringe {
                axis: Axis::X,
                period_px: self.period_px,
                phase_rad,
            };
            fringe.quantised_row(PIXELS, 8).unwrap_or_default()
        };
        let rows: Vec<Vec<u16>> = self.phases.iter().map(row).collect();
        let error = |pixel: u32| {
            let phi = TAU * f64::from(pixel) / self.period_px;
            let level = |row: &Vec<u16>| row.get(pixel as usize).map_or(0.0, |v| f64::from(*v));
            let levels: Vec<f64> = rows.iter().map(level).collect();
            let [_, c, s] = self.solve(&levels);
            let (sin, cos) = phi.sin_cos();
            (s * cos - c * sin).atan2(c * cos + s * sin) * self.period_px / TAU
        };
        let squares: f64 = (0..PIXELS).map(error).map(|e| e * e).sum();
        (squares / f64::from(PIXELS)).sqrt()
    }

    /// Returns whether the steps are N equal steps over one turn, to within a hundredth.
    pub fn steps_are_equal(&self) -> bool {
        let n = self.phases.len() as f64;
        let sum = |order: f64| {
            let turn = |(c, s): (f64, f64), t: &f64| (c + (order * t).cos(), s + (order * t).sin());
            let (c, s) = self.phases.iter().fold((0.0, 0.0), turn);
            c.hypot(s) / n
        };
        sum(1.0) < 0.01 && sum(2.0) < 0.01 && sum(n) > 0.99
    }

    /// Computes the sum of squared residuals of samples from their fit.
    pub fn residual(&self, samples: &[f64]) -> f64 {
        let [a, c, s] = self.solve(samples);
        self.phases
            .iter()
            .zip(samples)
            .map(|(t, v)| (v - (a + c * t.cos() - s * t.sin())).powi(2))
            .sum()
    }
}

/// Returns the residual of the samples +1, -1, +1, ... after the fit, as a unit vector. For an even
/// number N of equal steps all entries have the same magnitude, and the vector responds only to
/// harmonics of order N / 2 (the highest that N steps resolve) and its odd multiples.
fn check(rows: &[Vector3<f64>], weights: &[[f64; 3]]) -> Vec<f64> {
    if rows.len() < 4 {
        return Vec::new();
    }
    let signs = |i: usize| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
    let mut fit = Vector3::zeros();
    for (i, w) in weights.iter().enumerate() {
        fit += Vector3::from(*w) * signs(i);
    }
    let left: Vec<f64> = rows
        .iter()
        .enumerate()
        .map(|(i, row)| signs(i) - row.dot(&fit))
        .collect();
    let size = left.iter().map(|v| v * v).sum::<f64>().sqrt();
    if size < 0.5 {
        return Vec::new();
    }
    left.iter().map(|v| v / size).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn equal(n: usize) -> FringeSet {
        let phases = (0..n).map(|i| TAU * i as f64 / n as f64).collect();
        FringeSet::new("t", 16.0, (0..n).collect(), phases).unwrap()
    }

    #[test]
    fn equal_steps_have_the_closed_form() {
        for n in [3, 4, 5, 12] {
            let set = equal(n);
            for (i, w) in set.weights.iter().enumerate() {
                let t = TAU * i as f64 / n as f64;
                let truth = [1.0, 2.0 * t.cos(), -2.0 * t.sin()].map(|v| v / n as f64);
                assert!(w.iter().zip(truth).all(|(a, b)| (a - b).abs() < 1e-12));
            }
            let truth = 2.0 / n as f64;
            assert!((set.gram[0] - truth).abs() < 1e-12 && (set.gram[2] - truth).abs() < 1e-12);
            assert!(set.gram[1].abs() < 1e-12);
            // The third harmonics of the weights cancel for four or more equal steps.
            assert_eq!(n > 3, set.skew.iter().all(|t| t.abs() < 1e-12), "{n}");
        }
    }

    #[test]
    fn unsolvable_phase_steps_are_refused_by_name() {
        for phases in [vec![0.0, 1.0], vec![0.0, TAU / 2.0, TAU, 1.5 * TAU]] {
            let n = phases.len();
            let error = FringeSet::new("axis x, period 16 px", 16.0, (0..n).collect(), phases)
                .unwrap_err()
                .to_string();
            assert!(error.contains("axis x, period 16 px"), "{error}");
            assert!(error.contains("steps"), "{error}");
        }
    }

    proptest! {
        #[test]
        fn unequal_steps_recover_offset_amplitude_and_phase(
            phases in proptest::collection::vec(0.0..TAU, 3..13),
            x in 0.0..16.0f64, a in 0.0..200.0f64, b in 1.0..100.0f64,
        ) {
            let n = phases.len();
            if let Ok(set) = FringeSet::new("t", 16.0, (0..n).collect(), phases.clone()) {
                let phi = TAU * x / 16.0;
                let samples: Vec<f64> = phases.iter().map(|t| a + b * (phi + t).cos()).collect();
                let [fa, c, s] = set.solve(&samples);
                prop_assert!((fa - a).abs() < 1e-6);
                prop_assert!((c - b * phi.cos()).abs() < 1e-6 && (s - b * phi.sin()).abs() < 1e-6);
                prop_assert!(set.residual(&samples) < 1e-9);
            }
        }
    }
}
