//! The residuals of a fringe set's steps that are typical of a capture as a whole.
//!
//! Four or more steps leave a residual ([`FringeSet::check`](super::FringeSet::check)). A set of three
//! steps on an axis with several sets is checked by the difference of its mean from that of the other
//! sets. Residuals contain more than noise: a flickering lamp adds a fraction of the light and of the
//! fringe itself; a response curve adds its second harmonic with four steps, its third harmonic with six
//! steps and to the mean of three steps, and both with five steps. Each of these parts is the same
//! fraction everywhere, so a fit over the capture determines and removes it; damage to one pixel of one
//! frame remains. The remainder is compared with the camera's noise and the model error of a sample, or
//! with the remainder of most pixels if that is larger.

use super::deviation;
use super::options::Options;
use super::phase::{Check, MODEL_ERROR, RowNoise, SetKernel};
use super::sample::Sample;
use super::steps::FringeSet;
use nalgebra::{SMatrix, SVector};
use phasmid_core::statistics::median;
use phasmid_geometry::NoiseModel;

/// Approximate number of pixels sampled.
const PIXELS: usize = 4000;
/// Minimum number of pixels for a fit.
const FEWEST: usize = 50;
/// Maximum residual in standard deviations; noise exceeds it in 6 of 100,000 pixels.
const SIGMAS: f64 = 4.0;
/// Allowance for blur, as a fraction of the harmonics: blur changes them from one part of the image to
/// another.
const BLURRED: f64 = 0.75;
/// Number of fitted terms: the light, the two components of the fringe, and the two components each of
/// its second and third harmonics, if the set responds to them.
const TERMS: usize = 7;
/// Ridge term of the normal equations, as a fraction of their trace: unused terms get a coefficient of
/// 0.
const RIDGE: f64 = 1e-12;
/// Iterations of the robust fit.
const ROUNDS: usize = 4;
/// Residual in standard deviations above which a pixel is down-weighted in the fit.
const BENT: f64 = 2.0;
/// Minimum difference of a step's light, in standard errors; chance exceeds it in one of 60,000
/// captures.
const CERTAIN: f32 = 5.0;
/// Maximum length of the mean phasor: above it, coarse fringes do not determine the light of their
/// steps.
const LOPSIDED: f32 = 0.7;
/// Lower bound of the robust scale, as a fraction of noise and model error.
const LEAST: f64 = 0.5;

/// The common part of the residuals of all pixels of a set.
///
/// If one step has 1 + d times the light of the others, the residual grows by d w (A + C cos theta - S
/// sin theta), where w is the step's weight in the residual and theta its phase.
#[derive(Debug, Clone)]
pub(super) struct Shared {
    /// The common part, as fractions of the light above black and the two components of the fringe.
    light: [f32; 3],
    /// Weight of each step in the residual.
    weights: Vec<f32>,
    /// Scale of the remainder, in standard deviations of noise and model error.
    pub(super) scale: f32,
    fit: Fit,
}

/// How well the pixels of a capture determine the light of steps.
#[derive(Debug, Clone, Copy, Default)]
struct Fit {
    /// Length of the mean phasor of the pixels: near 1 if all have about the same phase, so that the
    /// three fractions cannot be separated.
    lopsided: f32,
    /// Standard error of each fraction in [`Shared::light`].
    light_error: f32,
    /// Scale of the residuals before the common part is removed.
    before: f32,
}

impl Shared {
    /// Whether the light of the steps differs by more than `limit` (in units of the residual) and by
    /// more than chance explains.
    pub(super) fn differs_by(&self, limit: f32) -> bool {
        self.difference() > limit.max(CERTAIN * self.fit.light_error)
    }

    /// Whether removing the common part reduces the scale by more than `factor`.
    pub(super) fn explains(&self, factor: f32) -> bool {
        self.fit.before > factor * self.scale
    }

    /// Difference in light of the steps, in units of the residual, reduced if the pixels' phases hardly
    /// vary; 0 if they do not determine it.
    pub(super) fn difference(&self) -> f32 {
        let lopsided = self.fit.lopsided;
        if lopsided > LOPSIDED {
            return 0.0;
        }
        let size = self
            .light
            .iter()
            .map(|part| part * part)
            .sum::<f32>()
            .sqrt();
        size * (1.0 - lopsided * lopsided)
    }

    /// Returns the step that alone explains the difference best, and its light relative to the other
    /// steps.
    pub(super) fn step(&self, set: &FringeSet) -> (usize, f64) {
        let along = |k: &usize| {
            let (sin, cos) = set.phases[*k].sin_cos();
            let [light, c, s] = self.light.map(f64::from);
            (light + c * cos - s * sin) / 2.0
        };
        let sizes = (0..set.phases.len()).map(|k| (k, along(&k)));
        let most = sizes.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        let (step, size) = most.unwrap_or_default();
        let part = size / f64::from(self.weights.get(step).copied().unwrap_or(1.0));
        // The fit absorbs a fraction 3 / N of the error of one step's sample.
        let followed = 3.0 / set.phases.len() as f64;
        (step, (1.0 + part / (1.0 - followed * part)).max(0.0))
    }
}

/// The residual of a fringe set that is typical of a capture.
#[derive(Debug, Clone, Copy)]
pub(super) struct RobustScale {
    /// Fitted coefficients of the terms.
    terms: [f32; TERMS],
    /// Allowed residual in standard deviations of noise and model error.
    deviations: f32,
    /// Additional allowed residual as a fraction of the modulation.
    modulation: f32,
    /// Median of the set's [`SetKernel::harmonic`] over pixels.
    pub(super) harmonic: f32,
    fit: Fit,
}

impl Default for RobustScale {
    /// Accepts every residual.
    fn default() -> Self {
        Self {
            terms: [0.0; TERMS],
            deviations: f32::INFINITY,
            modulation: 0.0,
            harmonic: 0.0,
            fit: Fit::default(),
        }
    }
}

/// A sampled pixel.
struct Pixel {
    terms: SVector<f64, TERMS>,
    check: f64,
    /// Standard deviation of the camera's noise and the model's error.
    sigma: f64,
    /// Remainder after the fit, in standard deviations.
    left: f64,
}

impl RobustScale {
    /// Fits the typical residual of one of an axis' sets, and its harmonic, to sampled pixels that
    /// have fringes and are not saturated.
    pub(super) fn of<T: Sample>(
        sets: &[SetKernel],
        set: &SetKernel,
        frames: &[&[T]],
        noise: &NoiseModel,
        saturation: f32,
        options: &Options,
    ) -> Self {
        let Some(first) = set.frames.first() else {
            return Self::default();
        };
        let row = RowNoise::new(noise);
        let [second, third] = set.check_responds();
        let used = |mut terms: [f32; TERMS]| {
            for (term, used) in terms[3..].iter_mut().zip([second, second, third, third]) {
                *term *= f32::from(u8::from(used));
            }
            terms
        };
        let (mut pixels, mut harmonics) = (Vec::new(), Vec::new());
        // Odd, so that the samples do not all fall into one image column.
        let stride = (frames[*first].len() / PIXELS) | 1;
        for i in (0..frames[*first].len()).step_by(stride) {
            let sample = |frame: usize| frames[frame][i].dn();
            let [a, c, s, own] = set.solve(sample);
            let b = c.hypot(s);
            let light = a - row.black;
            let dim = b < options.min_modulation_dn || b < options.min_contrast * light;
            if dim || light <= 0.0 || a + b >= saturation {
                continue;
            }
            harmonics.push(set.harmonic([c, s], a, sample));
            let check = match set.check {
                Check::None => continue,
                Check::Own => own,
                Check::Tied => set.tied(a, sets.iter().map(|set| set.solve(sample)[0]).sum()),
            };
            let sigma = f64::from(expected(light, b, row).max(1e-6).sqrt());
            pixels.push(Pixel {
                terms: used(terms(light, c, s, b)).map(f64::from).into(),
                check: f64::from(check),
                sigma,
                left: f64::from(check) / sigma,
            });
        }
        let harmonic = match harmonics.len() {
            ..FEWEST => 0.0,
            _ => median(&mut harmonics).unwrap_or(0.0),
        };
        if pixels.len() < FEWEST {
            return Self {
                harmonic,
                ..Self::default()
            };
        }
        let phasors = pixels.iter().map(|p| {
            let [_, c, s, ..]: [f64; TERMS] = p.terms.into();
            SVector::from([c, s]) / c.hypot(s).max(1e-9)
        });
        let lopsided = phasors.sum::<SVector<f64, 2>>().norm() / pixels.len() as f64;
        let (mut fitted, mut light_error) = (SVector::zeros(), f64::INFINITY);
        let before = deviation(&pixels);
        let mut scale = before;
        for _ in 0..ROUNDS {
            let Some((terms, error)) = fit(&pixels, scale) else {
                break;
            };
            (fitted, light_error) = (terms, error);
            for pixel in &mut pixels {
                pixel.left = (pixel.check - fitted.dot(&pixel.terms)) / pixel.sigma;
            }
            scale = deviation(&pixels);
        }
        Self {
            terms: fitted.map(|v| v as f32).into(),
            deviations: (SIGMAS * scale.max(1.0)) as f32,
            modulation: (BLURRED * (fitted[3].hypot(fitted[4]) + fitted[5].hypot(fitted[6])))
                as f32,
            harmonic,
            fit: Fit {
                lopsided: lopsided as f32,
                light_error: (scale * light_error) as f32,
                before: before as f32,
            },
        }
    }

    /// Returns the common part of the residuals of all pixels of a set; `None` if too few pixels show
    /// it.
    pub(super) fn shared(&self, set: &SetKernel) -> Option<Shared> {
        let [light, c, s, ..] = self.terms;
        let scale = self.deviations / SIGMAS as f32;
        scale.is_finite().then(|| Shared {
            light: [light, c, s],
            weights: set.check_weights(),
            scale,
            fit: self.fit,
        })
    }

    /// Returns the typical part of a pixel's residual, given its mean above black, both components
    /// of its fringe and their modulation, all in DN.
    #[inline(always)]
    pub(super) fn part(&self, light: f32, c: f32, s: f32, modulation: f32) -> f32 {
        let terms = terms(light, c, s, modulation);
        let mut sum = 0.0;
        for (part, term) in self.terms.iter().zip(terms) {
            sum += part * term;
        }
        sum
    }

    /// Returns the largest residual in DN, less the typical part, that is accepted for a pixel with
    /// this mean above black and modulation.
    #[inline(always)]
    pub(super) fn most(self, light: f32, modulation: f32, noise: RowNoise) -> f32 {
        self.deviations * expected(light, modulation, noise).sqrt() + self.modulation * modulation
    }
}

/// The variance in DN^2 that is expected of a residual, from noise and the model's error.
#[inline(always)]
fn expected(light: f32, modulation: f32, noise: RowNoise) -> f32 {
    let model = MODEL_ERROR as f32 * modulation;
    noise.variance(noise.black + light) + model * model
}

#[inline(always)]
fn terms(light: f32, c: f32, s: f32, modulation: f32) -> [f32; TERMS] {
    let (cos, sin) = (c / modulation, s / modulation);
    let second = [cos * c - sin * s, 2.0 * cos * s];
    let third = [(4.0 * cos * cos - 3.0) * c, (3.0 - 4.0 * sin * sin) * s];
    [light, c, s, second[0], second[1], third[0], third[1]]
}

/// Fits the terms by least squares; pixels far off in the last iteration are down-weighted. Also returns
/// the standard error of the first three terms, for remainders with a scale of 1.
fn fit(pixels: &[Pixel], scale: f64) -> Option<(SVector<f64, TERMS>, f64)> {
    let mut normal = SMatrix::<f64, TERMS, TERMS>::zeros();
    let mut right = SVector::<f64, TERMS>::zeros();
    for pixel in pixels {
        let bent = (BENT * scale / pixel.left.abs().max(1e-9)).min(1.0);
        let weight = bent / (pixel.sigma * pixel.sigma);
        normal += pixel.terms * pixel.terms.transpose() * weight;
        right += pixel.terms * (pixel.check * weight);
    }
    normal += SMatrix::identity() * (RIDGE * normal.trace());
    let factors = normal.cholesky()?;
    let variance = factors.inverse().diagonal().rows(0, 3).mean();
    Some((factors.solve(&right), variance.sqrt()))
}

/// Robust scale of the remainders, in standard deviations of noise and model error.
fn deviation(pixels: &[Pixel]) -> f64 {
    let mut sizes: Vec<f64> = pixels.iter().map(|p| p.left.abs()).collect();
    deviation::of_most(&mut sizes, LEAST, LEAST)
}
