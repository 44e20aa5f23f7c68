//! How far the steps of a fringe set contradict each other in a capture as a whole.
//!
//! Four or more steps leave a residual ([`FringeSet::check`](super::FringeSet::check)), and where an axis
//! has several sets, those of three steps have their mean less that of the others. It is not
//! noise alone: a flickering lamp leaves a part of the light and of the fringe itself, and
//! a response curve its second harmonic with four steps, its third in the mean of three. Each is the same part everywhere, so a fit over the
//! capture knows them, and takes them off; a damaged pixel of one frame is not usual. What is left is
//! held against the camera's noise, or against what is left of most pixels where that is more.

use super::phase::{Check, OWN, RowNoise, SetKernel, TIED};
use super::samples::Sample;
use super::{Options, deviation};
use nalgebra::{SMatrix, SVector};
use phasmid_geometry::NoiseModel;

/// Pixels that are looked at.
const PIXELS: usize = 4000;
/// Fewest of them that tell what is usual.
const FEWEST: usize = 50;
/// Deviations that a residual may have; noise has more in 6 of 100,000 pixels.
const SIGMAS: f64 = 4.0;
/// Part of the harmonic that blur takes away, or leaves, in some part of the image.
const BLURRED: f64 = 0.75;
/// Light, both parts of the fringe, both of a harmonic of it.
const TERMS: usize = 5;
/// Rounds of the robust fit.
const ROUNDS: usize = 4;
/// Deviations from which on a pixel weighs less in the fit.
const BENT: f64 = 2.0;
/// Least deviation of most pixels, in those of the camera's noise.
const LEAST: f64 = 0.5;

/// What is usual of the residual of a fringe set over a capture.
#[derive(Debug, Clone, Copy)]
pub(super) struct Usual {
    /// Parts of the terms.
    terms: [f32; TERMS],
    /// Deviations of the camera's noise that are believed.
    deviations: f32,
    /// Part of the modulation that is believed on top.
    modulation: f32,
}

impl Default for Usual {
    /// Nothing is unusual.
    fn default() -> Self {
        Self {
            terms: [0.0; TERMS],
            deviations: f32::INFINITY,
            modulation: 0.0,
        }
    }
}

/// A pixel that is looked at.
struct Pixel {
    terms: SVector<f64, TERMS>,
    check: f64,
    /// Deviation of the camera's noise.
    sigma: f64,
    /// What the terms leave, in deviations.
    left: f64,
}

impl Usual {
    /// What is usual of one of an axis' sets over pixels here and there that have fringes and are not
    /// saturated.
    pub(super) fn of<T: Sample>(
        sets: &[SetKernel],
        set: &SetKernel,
        frames: &[&[T]],
        noise: &NoiseModel,
        saturation: f32,
        options: &Options,
    ) -> Self {
        let Some(first) = set.frames.first().filter(|_| set.check != Check::None) else {
            return Self::default();
        };
        let row = RowNoise::new(noise);
        let mut pixels = Vec::new();
        // Odd, so that no column of an image is all there is.
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
            let (check, terms) = match set.check {
                Check::Tied => {
                    let all = sets.iter().map(|set| set.solve(sample)[0]).sum();
                    (set.tied(a, all), terms::<TIED>(light, c, s, b))
                }
                _ => (own, terms::<OWN>(light, c, s, b)),
            };
            let sigma = f64::from(row.variance(a).max(1e-6).sqrt());
            pixels.push(Pixel {
                terms: terms.map(f64::from).into(),
                check: f64::from(check),
                sigma,
                left: f64::from(check) / sigma,
            });
        }
        if pixels.len() < FEWEST {
            return Self::default();
        }
        let mut fitted = SVector::zeros();
        let mut scale = deviation(&pixels);
        for _ in 0..ROUNDS {
            let Some(found) = fit(&pixels, scale) else {
                break;
            };
            fitted = found;
            for pixel in &mut pixels {
                pixel.left = (pixel.check - fitted.dot(&pixel.terms)) / pixel.sigma;
            }
            scale = deviation(&pixels);
        }
        Self {
            terms: fitted.map(|v| v as f32).into(),
            deviations: (SIGMAS * scale.max(1.0)) as f32,
            modulation: (BLURRED * fitted[3].hypot(fitted[4])) as f32,
        }
    }

    /// The part of a pixel's residual that is usual: of a mean above black, both parts of its fringe
    /// and their modulation, all in DN.
    #[inline(always)]
    pub(super) fn part<const CHECK: u8>(&self, light: f32, c: f32, s: f32, modulation: f32) -> f32 {
        let terms = terms::<CHECK>(light, c, s, modulation);
        let mut sum = 0.0;
        for (part, term) in self.terms.iter().zip(terms) {
            sum += part * term;
        }
        sum
    }

    /// The largest residual in DN, less the usual part, that is believed of a pixel of a mean above
    /// black and a modulation.
    #[inline(always)]
    pub(super) fn most(self, light: f32, modulation: f32, noise: RowNoise) -> f32 {
        self.deviations * noise.variance(noise.black + light).sqrt() + self.modulation * modulation
    }
}

#[inline(always)]
fn terms<const CHECK: u8>(light: f32, c: f32, s: f32, modulation: f32) -> [f32; TERMS] {
    let (cos, sin) = (c / modulation, s / modulation);
    let harmonic = match CHECK {
        TIED => [(4.0 * cos * cos - 3.0) * c, (3.0 - 4.0 * sin * sin) * s],
        _ => [cos * c - sin * s, 2.0 * cos * s],
    };
    [light, c, s, harmonic[0], harmonic[1]]
}

/// Least squares of the terms, where pixels far off by the last round weigh less.
fn fit(pixels: &[Pixel], scale: f64) -> Option<SVector<f64, TERMS>> {
    let mut normal = SMatrix::<f64, TERMS, TERMS>::zeros();
    let mut right = SVector::<f64, TERMS>::zeros();
    for pixel in pixels {
        let bent = (BENT * scale / pixel.left.abs().max(1e-9)).min(1.0);
        let weight = bent / (pixel.sigma * pixel.sigma);
        normal += pixel.terms * pixel.terms.transpose() * weight;
        right += pixel.terms * (pixel.check * weight);
    }
    normal.cholesky().map(|c| c.solve(&right))
}

/// The deviation of most pixels, in deviations of the camera's noise.
fn deviation(pixels: &[Pixel]) -> f64 {
    let mut sizes: Vec<f64> = pixels.iter().map(|p| p.left.abs()).collect();
    deviation::of_most(&mut sizes, LEAST, LEAST)
}
