//! Phases that make use of shot noise: samples in a fringe's dark are better than those in its light,
//! which least squares over equal steps does not know.
//!
//! The samples at psi_i = phi + theta_i have the variance v (1 + m cos psi_i), m = gain B / v with v that
//! at the mean. With U_k the sum over the samples of sin(k psi_i) I_i, the error of the least-squares
//! phase is -2 / (N B) U_1. The noise couples each U_k with its neighbours: their covariances are N v / 2
//! times 1 for k with itself and m / 2 for k and k + 1. U_2 and U_3 hold no fringe, so what they read is
//! noise, and the part of it that U_1 shares is taken off the phase (Rao, "Least squares theory using
//! an estimated dispersion matrix", Proc. 5th Berkeley Symposium 1, 1967: least squares with weights
//! is least squares less its regression on the residuals). With t = m / 2 and U_2 alone the variance
//! falls by the factor 1 - t^2; with U_3 too by 1 - t^2 / (1 - t^2); with all there are by the
//! Cramer-Rao bound's (1 + sqrt(1 - m^2)) / 2, of whose deviation the two leave a hundredth unused at
//! m = 0.85.
//!
//! A response curve without memory, of projector or camera, makes harmonics cos(k psi), which no U_k
//! sees: it biases these phases no more than those of least squares. Fewer than six steps cannot tell
//! such harmonics from each other, and keep equal weights. Light that differs from step to step, and
//! motion, do show.

use super::steps::FringeSet;
use std::f64::consts::TAU;

/// By how much of a turn steps may differ from equal ones.
const EQUAL: f64 = 1e-6;

/// Most steps that are too few for the third harmonic.
pub(super) const WITHOUT_THIRD: usize = 7;

/// Largest correction in radians: more is no noise of a phase that is known at all.
const MOST: f32 = 0.5;

/// Weights of the frames of a set in cos 2, sin 2, cos 3 and sin 3 of its steps, 2 / N each; the last
/// two are zero where the steps are too few for them. `None` where the steps are not equal ones, or too few.
pub(super) fn harmonics(set: &FringeSet) -> Option<Vec<[f32; 4]>> {
    let n = set.phases.len();
    // Squares of the highest harmonic times the variance's swing must not alias to a mean.
    if n < 6 {
        return None;
    }
    let mut seen = vec![false; n];
    for phase in &set.phases {
        let place = phase / TAU * n as f64;
        if (place - place.round()).abs() > EQUAL * n as f64 {
            return None;
        }
        seen[(place.round() as i64).rem_euclid(n as i64) as usize] = true;
    }
    if !seen.iter().all(|&seen| seen) {
        return None;
    }
    let part = 2.0 / n as f64;
    let third = if n > WITHOUT_THIRD { part } else { 0.0 };
    let weights = |phase: &f64| {
        let ((s2, c2), (s3, c3)) = ((2.0 * phase).sin_cos(), (3.0 * phase).sin_cos());
        [part * c2, part * s2, third * c3, third * s3].map(|w| w as f32)
    };
    Some(set.phases.iter().map(weights).collect())
}

/// What to add to the phase in radians, and the factor of its variance: from the cosine and sine of the
/// least-squares phase, its modulation, half the variance's swing, and the sums that the weights of
/// [`harmonics`] give.
#[inline(always)]
pub(super) fn correction(
    [cos, sin]: [f32; 2],
    b: f32,
    half_swing: f32,
    sums: [f32; 4],
    third: bool,
) -> [f32; 2] {
    let t = half_swing.clamp(0.0, 0.5);
    let (cos2, sin2) = (cos * cos - sin * sin, 2.0 * sin * cos);
    let u2 = sin2 * sums[0] + cos2 * sums[1];
    let believed = |shift: f32| (shift / b).clamp(-MOST, MOST);
    if !third {
        return [believed(t * u2), 1.0 - t * t];
    }
    let (cos3, sin3) = (cos2 * cos - sin2 * sin, sin2 * cos + cos2 * sin);
    let u3 = sin3 * sums[2] + cos3 * sums[3];
    let share = t / (1.0 - t * t);
    [believed(share * (u2 - t * u3)), 1.0 - t * share]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn equal(n: usize) -> FringeSet {
        let phases = (0..n).rev().map(|i| TAU * i as f64 / n as f64).collect();
        FringeSet::new("t", 16.0, (0..n).collect(), phases).unwrap()
    }

    /// The correction of samples in f64.
    fn corrected(set: &FringeSet, samples: &[f64], m: f64) -> [f64; 2] {
        let [_, c, s] = set.solve(samples);
        let b = c.hypot(s);
        let weights = harmonics(set).unwrap();
        let sums = std::array::from_fn(|k| {
            let terms = weights
                .iter()
                .zip(samples)
                .map(|(w, v)| f64::from(w[k]) * v);
            terms.sum::<f64>() as f32
        });
        let direction = [(c / b) as f32, (s / b) as f32];
        let third = weights.len() > WITHOUT_THIRD;
        let [shift, factor] = correction(direction, b as f32, 0.5 * m as f32, sums, third);
        [s.atan2(c) + f64::from(shift), f64::from(factor)]
    }

    /// Each sample's weight in the phase, by differences; the variance that they give is the one that
    /// is said, and near the bound: the inverse of the information of the three unknowns.
    #[test]
    fn the_variance_is_the_one_said_and_near_the_bound() {
        for (n, worst) in [(6, 1.08), (7, 1.08), (8, 1.03), (12, 1.02), (32, 1.02)] {
            let set = equal(n);
            for m in [0.3, 0.6, 0.8] {
                for phi in [0.3, 1.1, 2.9, 4.4] {
                    let b = 50.0;
                    let psi: Vec<f64> = set.phases.iter().map(|t| phi + t).collect();
                    let clean: Vec<f64> = psi.iter().map(|p| 60.0 + b * p.cos()).collect();
                    let [phase, factor] = corrected(&set, &clean, m);
                    assert!(
                        (phase - phi)
                            .rem_euclid(TAU)
                            .min((phi - phase).rem_euclid(TAU))
                            < 1e-5
                    );
                    let mut information = nalgebra::Matrix3::zeros();
                    let mut variance = 0.0;
                    for i in 0..n {
                        let mut moved = clean.clone();
                        let step = 0.5;
                        moved[i] += step;
                        let slope = (corrected(&set, &moved, m)[0] - phase) / step;
                        let v = 1.0 + m * psi[i].cos();
                        variance += slope * slope * v;
                        let g = nalgebra::Vector3::new(1.0, psi[i].cos(), -b * psi[i].sin());
                        information += g * g.transpose() / v;
                    }
                    let plain = 2.0 / n as f64 / (b * b);
                    assert!((variance / (plain * factor) - 1.0).abs() < 0.03, "{n} {m}");
                    let bound = information.try_inverse().unwrap()[(2, 2)];
                    assert!(variance < bound * worst, "{n} {m} {}", variance / bound);
                }
            }
        }
    }

    #[test]
    fn response_curves_move_no_phase() {
        let set = equal(12);
        for phi in [0.2, 2.0, 5.0] {
            let bent = |t: &f64| 200.0 * (0.5 + 0.5 * (phi + t).cos()).powf(2.2);
            let samples: Vec<f64> = set.phases.iter().map(bent).collect();
            let [_, c, s] = set.solve(&samples);
            let [phase, _] = corrected(&set, &samples, 0.9);
            assert!((phase - s.atan2(c)).abs() < 1e-4);
        }
    }

    #[test]
    fn steps_that_are_few_or_not_equal_have_none() {
        for n in [3, 4, 5] {
            assert!(harmonics(&equal(n)).is_none());
        }
        let mut phases: Vec<f64> = (0..8).map(|i| TAU * f64::from(i) / 8.0).collect();
        phases[3] += 0.1;
        let set = FringeSet::new("t", 16.0, (0..8).collect(), phases).unwrap();
        assert!(harmonics(&set).is_none());
        let twice = [0.0, 0.0, 1.0, 2.0, 3.0, 4.0]
            .map(|i| TAU * i / 6.0)
            .to_vec();
        let set = FringeSet::new("t", 16.0, (0..6).collect(), twice).unwrap();
        assert!(harmonics(&set).is_none());
    }
}
