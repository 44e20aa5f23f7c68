//! Row kernels for the least squares of a fringe set: mean, modulation, wrapped coordinate and its
//! variance, in f32, with a layout that vectorises.

use super::Options;
use super::robust_scale::{MODEL_ERROR, RobustScale};
use super::sample::Sample;
use super::steps::FringeSet;
use super::turns::turns;
use super::weighted;
use phasmid_geometry::NoiseModel;
use std::f64::consts::TAU;

/// The camera's noise model in the form that a row kernel needs.
#[derive(Debug, Clone, Copy)]
pub(super) struct RowNoise {
    pub(super) floor: f32,
    pub(super) gain: f32,
    pub(super) black: f32,
}

impl RowNoise {
    pub(super) fn new(noise: &NoiseModel) -> Self {
        Self {
            floor: noise.variance_dn2(noise.black_level_dn) as f32,
            gain: noise.gain_dn_per_e as f32,
            black: noise.black_level_dn as f32,
        }
    }

    /// Variance in DN^2 at a mean in DN.
    #[inline(always)]
    pub(super) fn variance(&self, mean: f32) -> f32 {
        self.floor + self.gain * (mean - self.black).max(0.0)
    }
}

/// The consistency check of a pixel's samples of a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Check {
    /// No check.
    None,
    /// The residual of the set's own steps: see [`FringeSet::check`].
    Own,
    /// The difference between the set's mean and that of the other sets of its axis.
    Tied,
}

/// The kinds of [`Check`] as const parameters of the kernels.
pub(super) const UNCHECKED: u8 = Check::None as u8;
pub(super) const OWN: u8 = Check::Own as u8;
pub(super) const TIED: u8 = Check::Tied as u8;

/// The coefficients of a [`FringeSet`] in f32.
#[derive(Debug, Clone)]
pub(super) struct SetKernel {
    pub(super) period: f32,
    pub(super) frames: Vec<usize>,
    /// Weights of each frame in A, C, S and the check; the check's are zero if the set has none.
    weights: Vec<[f32; 4]>,
    /// The consistency check of the set.
    pub(super) check: Check,
    /// For a tied set, the weights of its own mean and of the sum of all sets' means; the difference
    /// has the variance of one sample.
    tie: [f32; 2],
    gram: [f32; 3],
    skew: [f32; 4],
    /// (period / 2 pi)^2: converts variance of phase to variance of position.
    per_phase: f32,
    /// Error of the coordinate due to the rounding of the pattern's levels, in projector pixels.
    rounding: f32,
    /// Weights of the frames in the sums of [`weighted`]; empty unless steps are weighted by shot
    /// noise.
    higher: Vec<[f32; 4]>,
}

impl SetKernel {
    /// Creates a kernel, with the check and with the weighting by shot noise if `options` ask for
    /// them and the set supports them.
    pub(super) fn new(set: &FringeSet, options: &Options) -> Self {
        Self {
            period: set.period_px as f32,
            frames: set.frames.clone(),
            weights: set
                .weights
                .iter()
                .enumerate()
                .map(|(i, w)| {
                    let check = set.check.get(i).copied().unwrap_or(0.0);
                    [w[0], w[1], w[2], check].map(|v| v as f32)
                })
                .collect(),
            check: match options.consistency && !set.check.is_empty() {
                true => Check::Own,
                false => Check::None,
            },
            tie: [0.0; 2],
            gram: set.gram.map(|v| v as f32),
            skew: set.skew.map(|v| v as f32),
            per_phase: (set.period_px / TAU).powi(2) as f32,
            rounding: set.rounding_px() as f32,
            higher: Some(set)
                .filter(|_| options.weighted)
                .and_then(weighted::harmonics)
                .unwrap_or_default(),
        }
    }

    /// Variance of the coordinate due to the error of the model of a sample, in projector pixels^2.
    pub(super) fn model_variance(&self) -> f32 {
        // Mean over all phases.
        let of_phase = 0.5 * (self.gram[0] + self.gram[2]);
        let of_samples = self.per_phase * of_phase * (MODEL_ERROR * MODEL_ERROR) as f32;
        of_samples.max(self.rounding * self.rounding)
    }

    /// Checks sets without a check of their own against the others of their axis: all should have the
    /// same mean.
    pub(super) fn tie(sets: &mut [Self]) {
        let variances: Vec<f32> = sets
            .iter()
            .map(|set| set.weights.iter().map(|w| w[0] * w[0]).sum())
            .collect();
        let (all, others) = (variances.iter().sum::<f32>(), sets.len() as f32 - 1.0);
        for (set, own) in sets.iter_mut().zip(variances) {
            if set.check == Check::None && others > 0.0 {
                let deviation = (own + (all - own) / (others * others)).sqrt();
                set.check = Check::Tied;
                set.tie = [1.0 + 1.0 / others, 1.0 / others].map(|w| w / deviation);
            }
        }
    }

    /// The weight of each step in the check.
    pub(super) fn check_weights(&self) -> Vec<f32> {
        let own = self.tie[0] - self.tie[1];
        let weight = |w: &[f32; 4]| match self.check {
            Check::Tied => own * w[0],
            _ => w[3],
        };
        self.weights.iter().map(weight).collect()
    }

    /// The check of a tied set from its `mean` and the sum of all sets' means, `all`.
    #[inline(always)]
    pub(super) fn tied(&self, mean: f32, all: f32) -> f32 {
        self.tie[0] * mean - self.tie[1] * all
    }

    /// A, C, S and the set's own check of one pixel; `sample` returns the pixel's sample in a frame.
    pub(super) fn solve(&self, sample: impl Fn(usize) -> f32) -> [f32; 4] {
        let mut sums = [0.0; 4];
        for (w, &frame) in self.weights.iter().zip(&self.frames) {
            let v = sample(frame);
            for (sum, w) in sums.iter_mut().zip(w) {
                *sum += w * v;
            }
        }
        sums
    }

    /// Sum over the steps of (dphi/dI)^2 (A + B cos(phi - step) - I) B: by how much harmonics of the
    /// samples I lower the variance of the phase. For N equal steps, B2 / (N B) with the second
    /// harmonic B2.
    pub(super) fn harmonic(
        &self,
        [c, s]: [f32; 2],
        mean: f32,
        sample: impl Fn(usize) -> f32,
    ) -> f32 {
        let mut sum = 0.0;
        for (w, &frame) in self.weights.iter().zip(&self.frames) {
            let slope = c * w[2] - s * w[1];
            sum -= slope * slope * (sample(frame) - mean);
        }
        let b2 = (c * c + s * s).max(1e-12);
        let [t0, t1, t2, t3] = self.skew;
        let odd = c * c * (c * t0 + s * t1) + s * s * (c * t2 + s * t3);
        (sum + odd) / (b2 * b2.sqrt())
    }

    /// Whether steps are weighted by their shot noise.
    pub(super) fn weighs(&self) -> bool {
        !self.higher.is_empty()
    }

    /// Variance of position that corresponds to a standard deviation of the phase.
    pub(super) fn variance_of_phase(&self, sigma_rad: f32) -> f32 {
        self.per_phase * sigma_rad * sigma_rad
    }
}

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
            // Written later, or never read.
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
    /// with H the harmonics' part ([`SetKernel::harmonic`]), which the capture's pixels have in common.
    #[inline(always)]
    pub(super) fn finish<const CHECK: u8>(
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
                // A lower bound for pixels whose mean and modulation contradict the noise model.
                let sum = (even + odd - harmonic * b2 * m[i]).max(0.1 * even);
                var[i] = kernel.per_phase * sum / (b2 * b2);
                if CHECK != UNCHECKED {
                    check[i] -= robust_scale.part::<CHECK>(mean[i] - noise.black, c, s, m[i]);
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
            if CHECK != UNCHECKED {
                check[i] -= robust_scale.part::<CHECK>(mean[i] - noise.black, c, s, b);
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
