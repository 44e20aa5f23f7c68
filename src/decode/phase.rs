//! The least squares of a fringe set in f32: its coefficients and check, and the noise of its samples.

use super::options::Options;
use super::steps::FringeSet;
use super::weighted;
use phasmid_geometry::NoiseModel;
use std::f64::consts::TAU;

/// Standard deviation of samples about their model, apart from the camera's noise, as a fraction of the
/// modulation: a projector rounds levels to 8 bits, which gives 1 / sqrt(12) / 127.5 = 0.0023. It is
/// larger for projectors of fewer bits.
pub const MODEL_ERROR: f64 = 0.0025;

/// Minimum response of a check to a harmonic, relative to the maximum possible, for the harmonic to
/// count.
const RESPONDS: f32 = 0.1;

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

/// How the samples of a fringe set at a pixel are checked for consistency.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Check {
    /// No check.
    None,
    /// The residual of the set's own steps: see [`FringeSet::check`].
    Own,
    /// The difference between the set's mean and that of the other sets of its axis.
    Tied,
}

/// The coefficients of a [`FringeSet`] in f32.
#[derive(Debug, Clone)]
pub(super) struct SetKernel {
    pub(super) period: f32,
    pub(super) frames: Vec<usize>,
    /// Phase of each step in radians.
    phases: Vec<f64>,
    /// Weights of each frame in A, C, S and the check; the weights in the check are zero if the set has
    /// no check.
    pub(super) weights: Vec<[f32; 4]>,
    /// The consistency check of the set.
    pub(super) check: Check,
    /// For a tied set, the weights of its own mean and of the sum of all sets' means; the difference
    /// has the variance of one sample.
    tie: [f32; 2],
    pub(super) gram: [f32; 3],
    pub(super) skew: [f32; 4],
    /// (period / 2 pi)^2: converts variance of phase to variance of position.
    pub(super) per_phase: f32,
    /// Error of the coordinate due to the rounding of the pattern's levels, in projector pixels.
    rounding: f32,
    /// Weights of the frames in the sums of [`weighted`]; empty unless steps are weighted by shot
    /// noise.
    pub(super) higher: Vec<[f32; 4]>,
}

impl SetKernel {
    /// Creates a kernel, with the check and with the weighting by shot noise if `options` ask for
    /// them and the set supports them.
    pub(super) fn new(set: &FringeSet, options: &Options) -> Self {
        Self {
            period: set.period_px as f32,
            frames: set.frames.clone(),
            phases: set.phases.clone(),
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

    /// Variance of the coordinate due to model errors of the samples ([`MODEL_ERROR`]), in projector
    /// pixels^2.
    pub(super) fn model_variance(&self) -> f32 {
        // Averages over all phases.
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

    /// Whether the check responds to the second and to the third harmonic of the fringe.
    pub(super) fn check_responds(&self) -> [bool; 2] {
        let weights = self.check_weights();
        let most: f32 = weights.iter().map(|w| w.abs()).sum();
        [2.0, 3.0].map(|order| {
            let turn = |(c, s): (f32, f32), (w, t): (&f32, &f64)| {
                let (sin, cos) = ((order * t) as f32).sin_cos();
                (c + w * cos, s + w * sin)
            };
            let (c, s) = weights.iter().zip(&self.phases).fold((0.0, 0.0), turn);
            c.hypot(s) > RESPONDS * most
        })
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

    /// Sum over the steps of (dphi/dI)^2 (A + B cos(phi - step) - I) B: the amount by which harmonics
    /// of the samples I lower the variance of the phase. For N equal steps it is B2 / (N B), where B2
    /// is the second harmonic.
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
