//! Approximation, by a sum of Gaussians, of the spread of light under skin.
//!
//! R(k)/R(0) of diffusion theory is a completely monotone function of k^2, since products of
//! 1/(sqrt(a + k^2) + b) are. By Bernstein's theorem it is therefore a mixture of exp(-sigma^2 k^2 /
//! 2) with nonnegative weights. This corresponds to a spread of light by Gaussians of several
//! widths, which combine with the projector's defocus by adding variances. A few Gaussians with
//! widths in geometric progression approximate it closely.

use super::Tissue;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// Maximum number of Gaussians in a mixture.
pub(crate) const MOST: usize = 8;
/// Highest spatial frequency at which the mixture is fitted, in cycles per millimetre.
const FINEST: f64 = 1.5;
/// Maximum difference between the transfer functions of mixture and tissue.
const CLOSE: f64 = 0.004;
/// Number of frequencies at which the mixture is fitted.
const SAMPLES: usize = 60;
/// Approximate fraction of all light that may be lost because Gaussians are truncated.
const TAIL: f64 = 1e-4;
/// Maximum distance, in standard deviations, at which a Gaussian is truncated.
const REACH: f64 = 4.0;

/// One Gaussian of a mixture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Component {
    /// Fraction of the light, 0 to 1.
    pub weight: f64,
    /// Standard deviation along any direction of the surface, in millimetres.
    pub sigma_mm: f64,
    /// Distance in standard deviations at which the Gaussian is truncated.
    pub reach: f64,
}

/// A sum of Gaussians on the surface whose weights add up to 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Mixture {
    components: Vec<Component>,
}

impl Mixture {
    /// Fits the smallest number of Gaussians that stays within 0.004 of the tissue's transfer
    /// function up to 1.5 cycles per millimetre, or the best eight Gaussians if more would be
    /// needed.
    pub fn new(tissue: &Tissue) -> Self {
        let samples: Vec<(f64, f64)> = (0..=SAMPLES)
            .map(|i| {
                // Samples are denser at low frequencies, where contrast falls most steeply.
                let k = TAU * FINEST * (i as f64 / SAMPLES as f64).powi(2);
                (k, tissue.transfer(k))
            })
            .collect();
        let mut best: Option<(f64, Self)> = None;
        for count in 3..=MOST {
            for wide in 0..8 {
                let widest = 0.5 * 1.35f64.powi(wide) / tissue.attenuation();
                for step in 0..10 {
                    let ratio = 1.5 * 1.15f64.powi(step);
                    let ladder: Vec<_> =
                        (0..count as i32).map(|j| widest / ratio.powi(j)).collect();
                    let fit = Self::fit(&ladder, &samples);
                    let error = fit.error(&samples);
                    if best.as_ref().is_none_or(|(least, _)| error < *least) {
                        best = Some((error, fit));
                    }
                }
            }
            if best.as_ref().is_some_and(|(least, _)| *least < CLOSE) {
                break;
            }
        }
        best.expect("there are ladders").1
    }

    fn fit(ladder: &[f64], samples: &[(f64, f64)]) -> Self {
        // A row with a large weight for k = 0 conserves energy; its residual is divided out
        // afterwards.
        let heavy = |i: usize| if i == 0 { 100.0 } else { 1.0 };
        let matrix = DMatrix::from_fn(samples.len(), ladder.len(), |i, j| {
            heavy(i) * (-0.5 * (ladder[j] * samples[i].0).powi(2)).exp()
        });
        let values = DVector::from_fn(samples.len(), |i, _| heavy(i) * samples[i].1);
        let weights = not_negative(&matrix, &values);
        let sum: f64 = weights.iter().sum();
        let components = ladder
            .iter()
            .zip(&weights)
            .filter(|(_, weight)| **weight > 0.0)
            .map(|(&sigma_mm, weight)| {
                let weight = weight / sum;
                let reach = (2.0 * (weight / TAIL).max(1.0).ln())
                    .sqrt()
                    .clamp(1.0, REACH);
                Component {
                    weight,
                    sigma_mm,
                    reach,
                }
            })
            .collect();
        Self { components }
    }

    fn error(&self, samples: &[(f64, f64)]) -> f64 {
        let off = |&(k, transfer): &(f64, f64)| (self.transfer(k) - transfer).abs();
        samples.iter().map(off).fold(0.0, f64::max)
    }

    /// Returns the Gaussians, widest first.
    pub fn components(&self) -> &[Component] {
        &self.components
    }

    /// Returns the fraction of its contrast that a cosine with `k_per_mm` radians per millimetre
    /// keeps.
    pub fn transfer(&self, k_per_mm: f64) -> f64 {
        let left = |c: &Component| c.weight * (-0.5 * (c.sigma_mm * k_per_mm).powi(2)).exp();
        self.components.iter().map(left).sum()
    }
}

/// Solves least squares with nonnegative weights by the normal equations: Lawson and Hanson,
/// "Solving Least Squares Problems" (1974), chapter 23. The caller must check the error of the fit.
fn not_negative(matrix: &DMatrix<f64>, values: &DVector<f64>) -> Vec<f64> {
    let n = matrix.ncols();
    let (normal, right) = (matrix.tr_mul(matrix), matrix.tr_mul(values));
    let mut weights = vec![0.0; n];
    let mut free = vec![false; n];
    // Each round frees one more weight; rounds that fix weights again are rare.
    for _ in 0..4 * n {
        let pull = &right - &normal * DVector::from_column_slice(&weights);
        let next = (0..n)
            .filter(|&j| !free[j] && pull[j] > 1e-9)
            .max_by(|&a, &b| pull[a].total_cmp(&pull[b]));
        let Some(next) = next else { break };
        free[next] = true;
        loop {
            let chosen: Vec<_> = (0..n).filter(|&j| free[j]).collect();
            let part = normal.select_columns(&chosen).select_rows(&chosen);
            let Some(factor) = part.cholesky() else {
                return weights;
            };
            let solved = factor.solve(&right.select_rows(&chosen));
            let blocking = |(&j, &s): (&usize, &f64)| {
                (s <= 0.0).then(|| weights[j] / (weights[j] - s).max(f64::MIN_POSITIVE))
            };
            let step = chosen
                .iter()
                .zip(solved.iter())
                .filter_map(blocking)
                .fold(1.0, f64::min);
            for (&j, s) in chosen.iter().zip(solved.iter()) {
                weights[j] += step * (s - weights[j]);
                if weights[j] <= 1e-12 {
                    (weights[j], free[j]) = (0.0, false);
                }
            }
            if step >= 1.0 || !free.contains(&true) {
                break;
            }
        }
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_gaussians_are_close_to_the_transfer() {
        for (absorption, scattering, bar) in [
            (0.02, 2.0, 0.005),
            (0.3, 3.5, 0.005),
            (0.005, 1.5, 0.005),
            (0.1, 4.0, 0.005),
            (5.0, 1.0, 0.005),
            (0.01, 100.0, 0.005),
            (1.0, 1e4, 0.005),
            (0.001, 0.1, 0.01),
        ] {
            let tissue = Tissue {
                absorption_per_mm: absorption,
                reduced_scattering_per_mm: scattering,
                refractive_index: 1.4,
            };
            let mixture = Mixture::new(&tissue);
            let count = mixture.components().len();
            assert!((1..=MOST).contains(&count));
            assert!(mixture.components().iter().all(|c| c.weight > 0.0));
            let sum: f64 = mixture.components().iter().map(|c| c.weight).sum();
            assert!((sum - 1.0).abs() < 1e-14 && mixture.transfer(0.0) == sum);
            // Also checks frequencies between the fitted ones.
            let worst = (0..=3000)
                .map(|i| TAU * f64::from(i) * 5e-4)
                .map(|k| (mixture.transfer(k) - tissue.transfer(k)).abs())
                .fold(0.0, f64::max);
            println!("{absorption} {scattering}: {count} {worst:.4} {mixture:?}");
            assert!(worst < bar, "{absorption} {scattering}: {worst} of {count}");
        }
    }
}
