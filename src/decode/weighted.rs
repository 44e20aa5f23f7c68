//! Phases weighted by shot noise: samples in a fringe's dark part are more precise than those in its
//! bright part, which least squares over equal steps ignores.
//!
//! Let sample i of N have the phase psi_i = phi + theta_i, where phi is the fringe phase and theta_i
//! the shift of the step, and let B be the modulation. The variance of the sample is
//! v (1 + m cos psi_i), where v is the variance at the mean intensity and m = gain B / v.
//! Let U_k be the sum over the samples of sin(k psi_i) I_i. The error of the least-squares phase is
//! -2 U_1 / (N B). Each U_k has the variance N v / 2, and U_k and U_(k + 1) have the covariance
//! N v m / 4. U_2 and U_3 contain only noise, because the fringe does not contribute to them. This
//! module subtracts from the phase the part of the noise that they predict (Rao, "Least squares
//! theory using an estimated dispersion matrix", Proc. 5th Berkeley Symposium 1, 1967: weighted least
//! squares equals unweighted least squares minus its regression on the residuals).
//!
//! With t = m / 2, the variance is multiplied by 1 - t^2 with U_2 alone, and by 1 - t^2 / (1 - t^2) with
//! U_2 and U_3. All harmonics reach the Cramer-Rao bound, (1 + sqrt(1 - m^2)) / 2; at m = 0.85 with U_2
//! and U_3 the standard deviation is within a hundredth of that bound.
//!
//! A memoryless response curve of projector or camera creates harmonics cos(k psi), which no U_k
//! contains, so it biases these phases no more than those of plain least squares. With fewer than six
//! steps such harmonics alias, so these sets keep equal weights. Motion, and light that varies from step
//! to step, do affect the correction.

use super::steps::FringeSet;
use std::f64::consts::TAU;

/// Maximum difference from equal steps, in turns.
const EQUAL: f64 = 1e-6;

/// Maximum number of steps for which the third harmonic is not used.
pub(super) const WITHOUT_THIRD: usize = 7;

/// Maximum correction in radians; larger values cannot be noise of a usable phase.
const MOST: f32 = 0.5;

/// Weights of the frames of a set in cos 2, sin 2, cos 3 and sin 3 of its steps, 2 / N each; the last
/// two are zero if there are too few steps for them. `None` if the steps are unequal or too few.
pub(super) fn harmonics(set: &FringeSet) -> Option<Vec<[f32; 4]>> {
    let n = set.phases.len();
    // The product of the squared highest harmonic and the variance's modulation must not alias to the
    // mean.
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

/// Returns the correction of the phase in radians and the factor by which it changes the phase's
/// variance, from the cosine and sine of the least-squares phase, its modulation `b`, half the relative
/// amplitude of the variance, and the sums of the weights of [`harmonics`].
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

    /// Computes each sample's weight in the phase by finite differences. The variance that these
    /// weights give equals the predicted one and is close to the Cramer-Rao bound for three unknowns.
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
    fn few_or_unequal_steps_have_no_harmonics() {
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
