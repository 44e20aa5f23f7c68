//! The standard deviation of a phase due to noise: the least-squares bound, the effect of rounding on
//! it, and the Cramer-Rao bound for noise that grows with the light.
//!
//! A pixel reads I_i = A + B cos(psi_i) + n_i at psi_i = phi + 2 pi i / N. Least squares has a
//! phase of standard deviation sqrt(2/N) sigma / B, with sigma at the mean A (Greivenkamp, Opt.
//! Eng. 23(4), 1984). Shot noise has the variance v_i = v (1 + m cos psi_i), where v is the
//! variance at A and m = K B / v: samples in the dark part of a fringe are more precise than those
//! in its bright part, which least squares ignores. The inverse of the Fisher information, the sum
//! over the samples of g g^T / v_i with g the derivatives of I_i with respect to A, B and phi,
//! bounds every unbiased estimator (Kay, "Fundamentals of Statistical Signal Processing: Estimation
//! Theory", 1993, chapter 3). The variance itself also contains information about the phase, K^2 /
//! 2 v_i^2; this information is some ten-thousandths of the total and is left out. For many steps
//! the sum is an integral, and the ratio of the bound to that of least squares is sqrt((1 + sqrt(1
//! - m^2)) / 2).

use nalgebra::{Matrix3, Vector3};
use phasmid_geometry::NoiseModel;
use std::f64::consts::{PI, TAU};

/// Number of phases over which phase-dependent bounds are averaged: coprime to the numbers of steps.
const PHASES: usize = 361;

/// Returns the standard deviation of the phase in radians for least squares over `steps` equal steps;
/// modulation and standard deviation of the samples are in the same unit.
pub(super) fn least_squares(steps: usize, modulation: f64, sigma: f64) -> f64 {
    (2.0 / steps as f64).sqrt() * sigma / modulation
}

/// Returns the relative amplitude m, 0 to 1, with which the variance follows the fringe.
pub(super) fn swing(noise: &NoiseModel, mean_dn: f64, modulation_dn: f64) -> f64 {
    noise.gain_dn_per_e * modulation_dn / noise.variance_dn2(mean_dn)
}

/// Returns the ratio of the Cramer-Rao bound to the least-squares bound for many steps and a variance
/// amplitude `m`.
pub(super) fn floor_of_many(m: f64) -> f64 {
    (0.5 + 0.5 * (1.0 - m * m).max(0.0).sqrt()).sqrt()
}

/// Returns the ratio of the Cramer-Rao bound to the least-squares bound for `steps` equal steps, both
/// as root mean squares over the phase.
pub(super) fn floor(steps: usize, m: f64) -> f64 {
    let variance = |phi: f64| {
        let mut information = Matrix3::zeros();
        for i in 0..steps {
            let (sin, cos) = (phi + TAU * i as f64 / steps as f64).sin_cos();
            let slope = Vector3::new(1.0, cos, -sin);
            information += slope * slope.transpose() / (1.0 + m * cos);
        }
        information.try_inverse().map_or(f64::NAN, |v| v[(2, 2)])
    };
    let sum: f64 = (0..PHASES)
        .map(|k| variance(TAU * k as f64 / PHASES as f64))
        .sum();
    (sum / PHASES as f64 / (2.0 / steps as f64)).sqrt()
}

/// Returns the ratio of the error of a phase from rounded samples to the bound that treats rounding as
/// white noise of variance 1/12. Both are root mean squares over phases and over positions of the mean
/// between two levels. `sigma` and `modulation` are in levels.
///
/// Rounding adds to a level x + n the error of a sawtooth, sum over k of (-1)^k sin(2 pi k (x + n)) /
/// (pi k). Its mean over n has the factors exp(-2 pi^2 k^2 sigma^2) (Widrow and Kollar, "Quantization
/// Noise", 2008, chapter 4) and is the same in every scan, so samples of one fringe with equal levels
/// share it. Over all positions of the mean, samples with levels d apart have the covariance g(d) = sum
/// over k of exp(-4 pi^2 k^2 sigma^2) cos(2 pi k d) / (2 pi^2 k^2); the remainder of 1/12 is white.
pub(super) fn rounded(steps: usize, modulation: f64, sigma: f64) -> f64 {
    let white = sigma * sigma + 1.0 / 12.0;
    let (mut own, mut shared) = (0.0, 0.0);
    for k in 1..200 {
        let weight = harmonic(k, sigma);
        if weight < 1e-9 {
            break;
        }
        own += weight;
        let waves = TAU * f64::from(k) * modulation;
        let mut sum = 0.0;
        for p in 0..PHASES {
            let phi = TAU * p as f64 / PHASES as f64 / steps as f64;
            let (mut re, mut im) = (0.0, 0.0);
            for i in 0..steps {
                let (sin, cos) = (phi + TAU * i as f64 / steps as f64).sin_cos();
                re += sin * (waves * cos).cos();
                im += sin * (waves * cos).sin();
            }
            sum += re * re + im * im;
        }
        shared += weight * sum / PHASES as f64;
    }
    ((white - own + shared * 2.0 / steps as f64) / white).sqrt()
}

/// Returns the variance of the k-th harmonic of rounding's mean error.
fn harmonic(k: u32, sigma: f64) -> f64 {
    let k = f64::from(k);
    (-(2.0 * PI * k * sigma).powi(2)).exp() / (2.0 * (PI * k).powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_integral_is_the_sum_of_many_steps() {
        for m in [0.0, 0.3, 0.8, 0.95] {
            assert!((floor(64, m) / floor_of_many(m) - 1.0).abs() < 1e-9, "{m}");
            // Three samples determine three unknowns, so weights change nothing.
            assert!((floor(3, m) - 1.0).abs() < 1e-9, "{m}");
        }
        let fives: Vec<f64> = [3, 4, 5, 6, 8, 12].map(|n| floor(n, 0.8)).to_vec();
        assert!(fives.is_sorted_by(|a, b| a > b), "{fives:?}");
    }

    #[test]
    fn rounding_is_white_from_half_a_level_of_noise_on() {
        for steps in [3, 4, 5, 8, 12, 32] {
            for modulation in [2.0, 17.3, 100.0] {
                let ratio = rounded(steps, modulation, 0.5);
                assert!((ratio - 1.0).abs() < 0.01, "{steps} {modulation} {ratio}");
            }
        }
        // Without noise, the variances of all harmonics add up to 1/12.
        let all: f64 = (1..100_000).map(|k| harmonic(k, 0.0)).sum();
        assert!((all - 1.0 / 12.0).abs() < 1e-6);
    }

    /// Compares [`rounded`] with the errors of rounded samples on a grid of phases and means. The only
    /// noise is uniform with a width of one level, which removes all harmonics.
    #[test]
    fn without_noise_the_error_is_that_of_rounded_samples() {
        for (steps, modulation) in [(12, 2.0), (5, 10.0)] {
            let (mut squares, mut count) = (0.0, 0.0);
            for a in 0..200 {
                for p in 0..211 {
                    let mean = 100.0 + (f64::from(a) + 0.5) / 200.0;
                    let phi = TAU * f64::from(p) / 211.0;
                    let (mut c, mut s) = (0.0, 0.0);
                    for i in 0..steps {
                        let (sin, cos) = (TAU * i as f64 / steps as f64).sin_cos();
                        let level =
                            (mean + modulation * (phi.cos() * cos - phi.sin() * sin)).round();
                        c += level * cos;
                        s -= level * sin;
                    }
                    let error = (s.atan2(c) - phi + PI).rem_euclid(TAU) - PI;
                    squares += error * error;
                    count += 1.0;
                }
            }
            let bound = least_squares(steps, modulation, (1.0f64 / 12.0).sqrt());
            let found = (squares / count).sqrt() / bound;
            // Only 200 harmonics are summed, which leaves 0.6 % of 1/12 as white noise.
            let expected = rounded(steps, modulation, 1e-9);
            assert!(
                (found / expected - 1.0).abs() < 0.03,
                "{steps} {found} {expected}"
            );
        }
    }
}
