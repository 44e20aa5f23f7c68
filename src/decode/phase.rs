//! Rows of pixels through the least squares of a fringe set: mean, modulation, wrapped coordinate
//! and its variance, in f32 and laid out to vectorise.

use super::Options;
use super::samples::Sample;
use super::steps::FringeSet;
use super::turns::turns;
use super::usual::Usual;
use super::weighted;
use phasmid_geometry::NoiseModel;
use std::f64::consts::TAU;

/// The camera's noise as a row kernel needs it.
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

/// What speaks against a pixel's samples of a set, beside their own noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Check {
    /// Nothing.
    None,
    /// What is left of the set's own steps: see [`FringeSet::check`].
    Own,
    /// The mean of the set less that of the others of its axis.
    Tied,
}

/// The kinds of [`Check`] as kernels are compiled for them.
pub(super) const UNCHECKED: u8 = Check::None as u8;
pub(super) const OWN: u8 = Check::Own as u8;
pub(super) const TIED: u8 = Check::Tied as u8;

/// The numbers of a [`FringeSet`] in f32.
#[derive(Debug, Clone)]
pub(super) struct SetKernel {
    pub(super) period: f32,
    pub(super) frames: Vec<usize>,
    /// Of A, C, S and the check; the check's are zero where there is none.
    weights: Vec<[f32; 4]>,
    /// What a pixel's samples are held against.
    pub(super) check: Check,
    /// Of a tied set: weights of its own mean and of the sum of all sets' means, whose difference has
    /// the variance of a sample.
    tie: [f32; 2],
    gram: [f32; 3],
    skew: [f32; 4],
    /// (period / 2 pi)^2: variance of phase to variance of position.
    per_phase: f32,
    /// Weights of the frames in the sums of [`weighted`], where shot noise is made use of.
    higher: Vec<[f32; 4]>,
}

impl SetKernel {
    /// With the check, and the sums that make use of shot noise, where they are wanted and the set has
    /// them.
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
            higher: Some(set)
                .filter(|_| options.weighted)
                .and_then(weighted::harmonics)
                .unwrap_or_default(),
        }
    }

    /// Ties sets that have no check of their own to the others of their axis: all see one mean.
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

    /// The check of a tied set whose mean is `mean`, of all sets' means.
    #[inline(always)]
    pub(super) fn tied(&self, mean: f32, all: f32) -> f32 {
        self.tie[0] * mean - self.tie[1] * all
    }

    /// A, C, S and the own check of one pixel, whose sample of a step's frame `sample` gives.
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

    /// Whether shot noise is made use of.
    pub(super) fn weighs(&self) -> bool {
        !self.higher.is_empty()
    }

    /// Variance of position at which the phase's standard deviation is `sigma_rad`.
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
    /// What no fringe explains, in DN: see [`Check`]; after [`Self::finish`] less what is usual. Of a
    /// kernel that has one only.
    pub(super) check: Vec<f32>,
    /// Cosine and sine sums of the second and third harmonic of the steps, in DN; unused where shot
    /// noise is not made use of.
    higher: [Vec<f32>; 4],
}

impl SetRow {
    /// Empties the sums for a row of `n` pixels.
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
            // Written later, or nobody looks at it.
            self.check.resize(n, 0.0);
        }
        if !kernel.higher.is_empty() {
            self.higher.iter_mut().for_each(clear);
        }
    }

    /// Adds the samples of step `step`, keeping the greatest sample in `top`; those of the check where
    /// the kernel has its `OWN`.
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

    /// Sums the higher harmonics over the samples of all steps, which `row` gives by their frames: a few
    /// pixels at a time, so that their sums stay in registers.
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

    /// Turns A, C, S into mean, modulation, wrapped coordinate and variance.
    ///
    /// The phase phi = atan2(S, C) has d phi = (C dS - S dC) / B^2. Samples' variances follow the
    /// linear noise model, so that of the phase is
    /// [v(A) (C^2 Gss - 2 C S Gcs + S^2 Gcc) + K (third-order terms of C and S)] / B^4.
    #[inline(always)]
    pub(super) fn finish<const CHECK: u8>(
        &mut self,
        kernel: &SetKernel,
        noise: RowNoise,
        usual: &Usual,
    ) {
        let n = self.mean.len();
        let (mean, m) = (&self.mean[..n], &mut self.modulation[..n]);
        let (w, var) = (&mut self.wrapped[..n], &mut self.variance[..n]);
        let check = &mut self.check[..n];
        let [gcc, gcs, gss] = kernel.gram;
        let [t0, t1, t2, t3] = kernel.skew.map(|t| t * noise.gain);
        if kernel.higher.is_empty() {
            for i in 0..n {
                let (c, s) = (m[i], w[i]);
                let b2 = (c * c + s * s).max(1e-12);
                let even =
                    noise.variance(mean[i]) * (c * c * gss - 2.0 * c * s * gcs + s * s * gcc);
                let odd = c * c * (c * t0 + s * t1) + s * s * (c * t2 + s * t3);
                // A pixel whose mean and modulation contradict the model still has some noise.
                let sum = (even + odd).max(0.1 * even);
                var[i] = kernel.per_phase * sum / (b2 * b2);
                m[i] = b2.sqrt();
                if CHECK != UNCHECKED {
                    check[i] -= usual.part::<CHECK>(mean[i] - noise.black, c, s, m[i]);
                }
                let x = kernel.period * turns(s, c);
                w[i] = if x >= kernel.period { 0.0 } else { x };
            }
            return;
        }
        // Six or more equal steps: the variance is v Gcc / B^2.
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
                check[i] -= usual.part::<CHECK>(mean[i] - noise.black, c, s, b);
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
