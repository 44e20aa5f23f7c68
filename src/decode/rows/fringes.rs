//! Row kernels for the least squares of a fringe set: mean, modulation, wrapped coordinate and its
//! variance, in f32, with a layout that vectorises.

use crate::phase::{Check, RowNoise, SetKernel};
use crate::robust_scale::RobustScale;
use crate::sample::Sample;
use crate::turns::turns;
use crate::weighted;

/// One fringe set's results over a row.
#[derive(Debug, Default)]
pub(super) struct SetRow {
    /// Mean A in DN.
    pub(super) mean: Vec<f32>,
    /// C; after [`Self::finish`] the modulation B in DN.
    pub(super) modulation: Vec<f32>,
    /// S; after [`Self::finish`] the coordinate modulo the period, in projector pixels.
    pub(super) wrapped: Vec<f32>,
    /// Variance of the coordinate in projector pixels squared.
    pub(super) variance: Vec<f32>,
    /// The value of the [`Check`] in DN; after [`Self::finish`] minus the value typical of the
    /// capture. Only meaningful if the kernel has a check.
    pub(super) check: Vec<f32>,
    /// Cosine and sine sums of the second and third harmonic of the steps, in DN; unused unless steps
    /// are weighted by shot noise.
    higher: [Vec<f32>; 4],
}

impl SetRow {
    /// Clears the sums for a row of `n` pixels.
    pub(super) fn reset(&mut self, kernel: &SetKernel, n: usize) {
        let clear = |v: &mut Vec<f32>| {
            v.clear();
            v.resize(n, 0.0);
        };
        for v in [
            &mut self.mean,
            &mut self.modulation,
            &mut self.wrapped,
            &mut self.variance,
        ] {
            clear(v);
        }
        if kernel.check == Check::Own {
            clear(&mut self.check);
        } else {
            // These values are written later, or never read.
            self.check.resize(n, 0.0);
        }
        if !kernel.higher.is_empty() {
            self.higher.iter_mut().for_each(clear);
        }
    }

    /// Adds the samples of step `step` and keeps the maximum sample in `top`. Adds to the check if
    /// `OWN`.
    #[inline(always)]
    pub(super) fn add<T: Sample, const OWN: bool>(
        &mut self,
        kernel: &SetKernel,
        step: usize,
        samples: &[T],
        top: &mut [f32],
    ) {
        let [wa, wc, ws, wr] = kernel.weights[step];
        let n = samples.len();
        let (a, c, s) = (
            &mut self.mean[..n],
            &mut self.modulation[..n],
            &mut self.wrapped[..n],
        );
        let (top, check) = (&mut top[..n], &mut self.check[..n]);
        for i in 0..n {
            let v = samples[i].dn();
            a[i] += wa * v;
            c[i] += wc * v;
            s[i] += ws * v;
            if OWN {
                check[i] += wr * v;
            }
            top[i] = top[i].max(v);
        }
    }

    /// Sums the higher harmonics over the samples of all steps; `row` returns a frame's row. Works on
    /// a few pixels at a time, so that the sums stay in registers.
    #[inline(always)]
    pub(super) fn add_higher<'f, T: Sample>(
        &mut self,
        kernel: &SetKernel,
        row: &impl Fn(usize) -> &'f [T],
    ) {
        const LANES: usize = 16;
        let n = self.mean.len();
        let steps = || kernel.frames.iter().zip(&kernel.higher);
        let whole = n - n % LANES;
        for first in (0..whole).step_by(LANES) {
            let mut sums = [[0.0; LANES]; 4];
            for (&frame, weights) in steps() {
                let (samples, _) = row(frame)[first..first + LANES].as_chunks::<LANES>();
                for i in 0..LANES {
                    let v = samples[0][i].dn();
                    for k in 0..4 {
                        sums[k][i] += weights[k] * v;
                    }
                }
            }
            for (higher, sums) in self.higher.iter_mut().zip(&sums) {
                higher[first..first + LANES].copy_from_slice(sums);
            }
        }
        for (&frame, weights) in steps() {
            let samples = &row(frame)[whole..n];
            for (higher, weight) in self.higher.iter_mut().zip(weights) {
                for (sum, sample) in higher[whole..n].iter_mut().zip(samples) {
                    *sum += weight * sample.dn();
                }
            }
        }
    }

    /// Converts A, C, S to mean, modulation, wrapped coordinate and variance.
    ///
    /// The phase phi = atan2(S, C) has d phi = (C dS - S dC) / B^2. The samples' variances follow the
    /// linear noise model, so the variance of the phase is
    /// [v(A) (C^2 Gss - 2 C S Gcs + S^2 Gcc) + K (third-order terms of C and S) - K H B^3] / B^4
    /// with H the harmonics' term ([`SetKernel::harmonic`]), one value for all pixels of the capture.
    #[inline(always)]
    pub(super) fn finish<const CHECKED: bool>(
        &mut self,
        kernel: &SetKernel,
        noise: RowNoise,
        robust_scale: &RobustScale,
    ) {
        let n = self.mean.len();
        let (mean, m) = (&self.mean[..n], &mut self.modulation[..n]);
        let (w, var) = (&mut self.wrapped[..n], &mut self.variance[..n]);
        let check = &mut self.check[..n];
        let [gcc, gcs, gss] = kernel.gram;
        let [t0, t1, t2, t3] = kernel.skew.map(|t| t * noise.gain);
        let harmonic = robust_scale.harmonic * noise.gain;
        if kernel.higher.is_empty() {
            for i in 0..n {
                let (c, s) = (m[i], w[i]);
                let b2 = (c * c + s * s).max(1e-12);
                let even =
                    noise.variance(mean[i]) * (c * c * gss - 2.0 * c * s * gcs + s * s * gcc);
                let odd = c * c * (c * t0 + s * t1) + s * s * (c * t2 + s * t3);
                m[i] = b2.sqrt();
                // A lower bound protects pixels whose mean and modulation contradict the noise model.
                let sum = (even + odd - harmonic * b2 * m[i]).max(0.1 * even);
                var[i] = kernel.per_phase * sum / (b2 * b2);
                if CHECKED {
                    check[i] -= robust_scale.part(mean[i] - noise.black, c, s, m[i]);
                }
                let x = kernel.period * turns(s, c);
                w[i] = if x >= kernel.period { 0.0 } else { x };
            }
            return;
        }
        // Weighting requires six or more equal steps: the unweighted variance is then v Gcc / B^2.
        let third = kernel.higher.len() > weighted::WITHOUT_THIRD;
        let [u0, u1, u2, u3] = self.higher.each_ref().map(|sum| &sum[..n]);
        let per_radian = kernel.per_phase.sqrt();
        for i in 0..n {
            let (c, s) = (m[i], w[i]);
            let b = (c * c + s * s).max(1e-12).sqrt();
            let variance = noise.variance(mean[i]);
            let sums = [u0[i], u1[i], u2[i], u3[i]];
            let half_swing = 0.5 * noise.gain * b / variance;
            let [shift, factor] = weighted::correction([c / b, s / b], b, half_swing, sums, third);
            var[i] = kernel.per_phase * factor * variance * gcc / (b * b);
            m[i] = b;
            if CHECKED {
                check[i] -= robust_scale.part(mean[i] - noise.black, c, s, b);
            }
            let x = kernel.period * turns(s, c) + per_radian * shift;
            let x = if x < 0.0 { x + kernel.period } else { x };
            w[i] = if x >= kernel.period {
                x - kernel.period
            } else {
                x
            };
        }
    }
}
