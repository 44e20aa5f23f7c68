//! Frames computed in f64 from the patterns' formulas, without any of the decoder's code, and the
//! errors of their decoded coordinates.

use super::rays::EPS_F32;
use crate::draws::Draws;
use phasmid_core::error::Result;
use phasmid_decode::{Decoder, Options, Verdict};
use phasmid_geometry::NoiseModel;
use phasmid_pattern::{Axis, Image, Manifest, ManifestFrame, Pattern, ProjectorSize};
use phasmid_report::lab::Context;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Columns of a synthetic frame.
pub(super) const WIDTH: usize = 256;
/// Projector pixels between neighbouring columns of [`sweep`].
pub(super) const SWEEP_STEP: f64 = 7.37;
/// Columns of the projector.
pub(super) const EXTENT: f64 = 1920.0;

/// Synthetic frames of patterns: `floor + swing * level`, with noise, rounding and clipping.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stack {
    pub(super) floor: f64,
    pub(super) swing: f64,
    /// Standard deviation in DN before rounding.
    pub(super) noise: f64,
    /// Width of a camera pixel's footprint in projector pixels.
    pub(super) footprint: f64,
    /// Whether fringes are levels of whole projector pixels averaged over the footprint, instead of the
    /// formula's value at its centre.
    pub(super) held: bool,
    /// Full scale of the converter; above 255, frames have 16 bits.
    pub(super) full: f64,
    /// Step of the converter: all levels are multiples of this value.
    pub(super) grain: f64,
    pub(super) draws: Draws,
}

/// Errors of decoded coordinates.
#[derive(Debug, Clone, Default)]
pub(super) struct Tally {
    /// Share of pixels with a coordinate.
    pub(super) kept: f64,
    /// Fraction of these pixels with a gross error.
    pub(super) gross: f64,
    /// RMS error of the other pixels, in projector pixels.
    pub(super) rms: f64,
    /// Largest error of all pixels, in projector pixels.
    pub(super) worst: f64,
    /// RMS of the stated standard uncertainties, in projector pixels.
    pub(super) stated: f64,
    /// Number of finest Gray bits that the decoder left out.
    pub(super) unused_bits: usize,
    /// Reasons for missing coordinates, with fractions.
    pub(super) masked: String,
}

impl Stack {
    /// Returns frames with eight bits, a modulation of 90 DN and noise of 1.5 DN.
    pub(super) fn usual(context: &Context<'_>, stream: usize) -> Self {
        Self {
            floor: 20.0,
            swing: 180.0,
            noise: 1.5,
            footprint: 4.0,
            held: false,
            full: 255.0,
            grain: 1.0,
            draws: Draws::new(context.seed, 100 + stream as u32),
        }
    }

    /// Returns the standard deviation of a sample including rounding, in DN.
    pub(super) fn deviation(&self) -> f64 {
        (self.noise.powi(2) + self.grain.powi(2) / 12.0).sqrt()
    }

    /// Returns decoder options with the noise model that a calibration would provide.
    pub(super) fn options(&self) -> Options {
        let read = self.deviation().powi(2) - 1.0 / 12.0;
        Options {
            noise: Some(NoiseModel {
                gain_dn_per_e: 0.0,
                read_noise_dn: read.max(0.0).sqrt(),
                black_level_dn: 0.0,
                saturation_dn: self.full,
            }),
            ..Options::default()
        }
    }

    /// Returns the level of a pattern at a position: Gray code, and fringes if `held` is set, are held
    /// pixels averaged over the footprint; other fringes follow their formula.
    fn level(&self, pattern: &Pattern, x: f64) -> f64 {
        match *pattern {
            Pattern::Fringe {
                period_px,
                phase_rad,
                ..
            } if !self.held => 0.5 + 0.5 * (TAU * (x / period_px).fract() + phase_rad).cos(),
            Pattern::Fringe { .. } | Pattern::Gray { .. } => {
                let (lo, hi) = (x - 0.5 * self.footprint, x + 0.5 * self.footprint);
                let (mut sum, mut weight) = (0.0, 0.0);
                let mut i = (lo + 0.5).floor().max(0.0);
                while i - 0.5 < hi {
                    let overlap = (hi.min(i + 0.5) - lo.max(i - 0.5)).max(0.0);
                    sum += overlap * pattern.level(i as u32).unwrap_or(0.0);
                    weight += overlap;
                    i += 1.0;
                }
                sum / weight
            }
            ref uniform => uniform.level(0).unwrap_or(0.0),
        }
    }

    fn frame(&self, index: usize, pattern: &Pattern, positions: &[f64]) -> Vec<u16> {
        let sample = |(i, &x): (usize, &f64)| {
            let noise = if self.noise > 0.0 {
                self.noise * self.draws.normals((index as u64) << 32 | i as u64).x
            } else {
                0.0
            };
            let dn = self.floor + self.swing * self.level(pattern, x) + noise;
            let steps = (dn / self.grain).round() * self.grain;
            steps.clamp(0.0, self.full) as u16
        };
        positions.iter().enumerate().map(sample).collect()
    }

    /// Renders and decodes frames of a surface that shows the positions row by row. Errors above
    /// `gross` are counted, not averaged.
    pub(super) fn decode(
        &self,
        patterns: Vec<Pattern>,
        positions: &[f64],
        options: Options,
        gross: f64,
    ) -> Result<Tally> {
        let manifest = manifest(patterns);
        let height = positions.len() / WIDTH;
        let decoder = Decoder::new(&manifest, WIDTH, height, None, options)?;
        let frames: Vec<Vec<u16>> = manifest
            .frame
            .par_iter()
            .enumerate()
            .map(|(k, f)| self.frame(k, &f.pattern, positions))
            .collect();
        let image = |frame: Vec<u16>| match self.full > 255.0 {
            true => Image::new(WIDTH, height, frame),
            false => {
                let bytes: Vec<u8> = frame.into_iter().map(|level| level as u8).collect();
                Image::new(WIDTH, height, bytes)
            }
        };
        let images = frames.into_iter().map(image).collect::<Result<Vec<_>>>()?;
        let decoded = decoder.decode(&images)?;
        let map = decoded.x.unwrap_or_default();
        let (mut counts, mut wrong, mut squares, mut worst) = ([0.0; 7], 0.0, 0.0, 0.0_f64);
        let mut variances = 0.0;
        let found = map.coordinate.iter().zip(&map.verdict).zip(positions);
        for (i, ((&x, &verdict), truth)) in found.enumerate() {
            counts[verdict as usize] += 1.0;
            if verdict != Verdict::Valid {
                continue;
            }
            variances += f64::from(map.uncertainty(i)).powi(2);
            let error = (f64::from(x) - truth).abs();
            // A NaN counts as an infinite error, whatever the verdict.
            worst = if error.is_nan() {
                f64::INFINITY
            } else {
                worst.max(error)
            };
            if error <= gross {
                squares += error * error;
            } else {
                wrong += 1.0;
            }
        }
        let (all, valid) = (positions.len() as f64, counts[Verdict::Valid as usize]);
        let reasons = Verdict::ALL.into_iter().skip(1);
        let reasons = reasons.filter(|v| counts[*v as usize] >= 0.0005 * all);
        let masked: Vec<String> = reasons
            .map(|v| format!("{} {:.1} %", v.name(), 100.0 * counts[v as usize] / all))
            .collect();
        Ok(Tally {
            kept: valid / all,
            gross: wrong / valid.max(1.0),
            rms: (squares / f64::max(valid - wrong, 1.0)).sqrt(),
            worst,
            stated: (variances / valid.max(1.0)).sqrt(),
            unused_bits: map.unused_bits,
            masked: masked.join(", "),
        })
    }
}

/// Returns the least-squares bound on the error of a coordinate: sqrt(2/N) sigma / B times period / 2
/// pi (see `decode`'s `steps`).
pub(super) fn bound(period: f64, steps: usize, deviation: f64, modulation: f64) -> f64 {
    period / TAU * (2.0 / steps as f64).sqrt() * deviation / modulation
}

/// Returns the worst-case f32 rounding error of a coordinate in projector pixels: N products are summed
/// one by one, each as large as mean and modulation together; the angle's polynomial is off by 1e-6
/// rad, as in its own test; and the coordinate and the offset of the period are each rounded.
pub(super) fn f32_floor(period: f64, steps: usize, mean: f64, modulation: f64) -> f64 {
    let sums = 2.0 * steps as f64 * EPS_F32 * (mean + modulation) / modulation;
    period / TAU * (sums + 1e-6) + 2.0 * EPS_F32 * EXTENT
}

/// Returns the largest error of the phase of N equal steps due to rounding by half a step, in units of
/// the step over B: the largest sum of |sin| over the steps, over all phases.
pub(super) fn rounding_gain(steps: usize) -> f64 {
    let sum = |phi: f64| -> f64 {
        let of = |i: usize| (TAU * i as f64 / steps as f64 + phi).sin().abs();
        (0..steps).map(of).sum()
    };
    let phases = (0..2000).map(|k| TAU * f64::from(k) / 2000.0);
    phases.map(sum).fold(0.0, f64::max) / steps as f64
}

/// Returns the positions of a smooth surface that covers the projector's columns with all phases.
pub(super) fn sweep(context: &Context<'_>) -> Vec<f64> {
    let height = if context.settings.quick { 40 } else { 160 };
    (0..WIDTH * height)
        .map(|i| {
            let (u, v) = ((i % WIDTH) as f64, (i / WIDTH) as f64);
            10.0 + SWEEP_STEP * u + 3.0 * (v * 0.11).sin() + 0.0317 * v
        })
        .collect()
}

/// Returns the steps of a fringe along x.
pub(super) fn fringes(period_px: f64, phases: &[f64]) -> Vec<Pattern> {
    let one = |&phase_rad: &f64| Pattern::Fringe {
        axis: Axis::X,
        period_px,
        phase_rad,
    };
    phases.iter().map(one).collect()
}

/// Returns N equal steps along x.
pub(super) fn equal(period_px: f64, steps: usize) -> Vec<Pattern> {
    let phases: Vec<f64> = (0..steps).map(|i| TAU * i as f64 / steps as f64).collect();
    fringes(period_px, &phases)
}

/// Returns all bits of a Gray code along x, with complements or without.
pub(super) fn gray(cell_px: f64, complements: bool) -> Vec<Pattern> {
    let bits = (EXTENT / cell_px).log2().ceil().max(1.0) as u32;
    bit_frames(cell_px, bits, 0..bits, complements)
}

/// Returns the finest bit of a Gray code along x.
pub(super) fn finest_bit(cell_px: f64) -> Vec<Pattern> {
    bit_frames(cell_px, 8, 0..1, false)
}

fn bit_frames(
    cell_px: f64,
    bits: u32,
    shown: std::ops::Range<u32>,
    complements: bool,
) -> Vec<Pattern> {
    let kinds: &[bool] = if complements {
        &[false, true]
    } else {
        &[false]
    };
    let one = move |bit| {
        kinds.iter().map(move |&inverted| Pattern::Gray {
            axis: Axis::X,
            cell_px,
            bits,
            bit,
            inverted,
        })
    };
    shown.rev().flat_map(one).collect()
}

/// Returns a white and a black frame.
pub(super) fn references() -> Vec<Pattern> {
    vec![Pattern::White {}, Pattern::Black {}]
}

/// Returns a sequence for the projector.
pub(super) fn manifest(patterns: Vec<Pattern>) -> Manifest {
    let frame = patterns.into_iter().map(|pattern| ManifestFrame {
        file: None,
        pattern,
    });
    Manifest {
        projector: ProjectorSize {
            width_px: EXTENT as u32,
            height_px: 1080,
        },
        frame: frame.collect(),
    }
}
