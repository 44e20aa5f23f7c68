//! Frames of a known fringe, read by a profile's sensor: as the device would render them for a smooth
//! surface, but without optics.

use phasmid_core::error::Result;
use phasmid_decode::{Decoder, Options};
use phasmid_geometry::NoiseModel;
use phasmid_pattern::{Axis, Image, Manifest, ManifestFrame, Pattern, ProjectorSize, Samples};
use phasmid_profile::Sensor;
use phasmid_render::read_out;
use std::f64::consts::TAU;

/// Period of the fringes in projector pixels, as `pmp-bench` has them.
pub(super) const PERIOD_PX: f64 = 16.0;
const WIDTH: usize = 256;
/// Projector pixels between neighbouring camera pixels, which is also the width of a footprint.
const STEP_PX: f64 = 1.7;

/// A fringe on a surface; pixels differ only in their phase and slightly in their mean.
#[derive(Debug, Clone)]
pub(super) struct Fringe {
    /// Number of steps N.
    pub(super) steps: usize,
    /// Modulation B in digital numbers.
    pub(super) modulation_dn: f64,
    /// Mean A in digital numbers, including the black level. The means of pixels differ from it by up to
    /// half a digital number, so that not all are rounded alike.
    pub(super) mean_dn: f64,
    /// The sensor that reads the fringe.
    pub(super) sensor: Sensor,
    /// Number of rows of 256 pixels.
    pub(super) rows: usize,
}

/// One scan of a [`Fringe`].
pub(super) struct Stack {
    fringe: Fringe,
    manifest: Manifest,
    images: Vec<Image>,
}

impl Fringe {
    /// Returns the number of pixels.
    pub(super) fn pixels(&self) -> usize {
        WIDTH * self.rows
    }

    /// Returns the noise model for the decoder.
    pub(super) fn noise(&self) -> NoiseModel {
        self.sensor.noise_model(0.0, 0.0)
    }

    /// Returns the projector column that a pixel sees: linear along a row, and with all phases over the
    /// rows.
    pub(super) fn position_px(&self, pixel: usize) -> f64 {
        let (u, v) = ((pixel % WIDTH) as f64, (pixel / WIDTH) as f64);
        12.0 + STEP_PX * u + 0.0371 * v
    }

    /// Returns a pixel's mean in digital numbers, from an additive recurrence with the golden ratio.
    pub(super) fn mean_dn_at(&self, pixel: usize) -> f64 {
        self.mean_dn + (pixel as f64 * 0.618_033_988_749_894_9).fract() - 0.5
    }

    /// Returns the sequence of `pmp-bench`: fringes, Gray code with a complementary bit, white and
    /// black.
    fn manifest(&self) -> Manifest {
        let fringe = |i: usize| Pattern::Fringe {
            axis: Axis::X,
            period_px: PERIOD_PX,
            phase_rad: TAU * i as f64 / self.steps as f64,
        };
        let gray = |cell_px: f64, bits: u32, bit: u32| Pattern::Gray {
            axis: Axis::X,
            cell_px,
            bits,
            bit,
            inverted: false,
        };
        let coarse = (0..7).rev().map(|bit| gray(PERIOD_PX, 7, bit));
        let patterns = (0..self.steps)
            .map(fringe)
            .chain(coarse)
            .chain([gray(0.5 * PERIOD_PX, 8, 0)])
            .chain([Pattern::White {}, Pattern::Black {}]);
        let frame = |pattern| ManifestFrame {
            file: None,
            pattern,
        };
        Manifest {
            projector: ProjectorSize {
                width_px: 1920,
                height_px: 1080,
            },
            frame: patterns.map(frame).collect(),
        }
    }

    /// Scans the fringe; `seed` keys the noise.
    pub(super) fn scan(&self, seed: u64) -> Stack {
        let manifest = self.manifest();
        let single = self.sensor.bits <= 8;
        let frame = |(id, frame): (usize, &ManifestFrame)| {
            let signal: Vec<f32> = (0..self.pixels())
                .map(|i| {
                    let swing = level(&frame.pattern, self.position_px(i));
                    (self.mean_dn_at(i) + self.modulation_dn * swing) as f32
                })
                .collect();
            let bytes = read_out(&self.sensor, [seed, id as u64], &signal);
            let samples = match single {
                true => Samples::U8(bytes),
                false => {
                    let (pairs, _) = bytes.as_chunks();
                    Samples::U16(pairs.iter().map(|pair| u16::from_le_bytes(*pair)).collect())
                }
            };
            Image::new(WIDTH, self.rows, samples)
        };
        let images = manifest.frame.iter().enumerate().map(frame);
        let images = images
            .collect::<Result<_>>()
            .expect("a sample for each pixel");
        Stack {
            fringe: self.clone(),
            manifest,
            images,
        }
    }
}

impl Stack {
    /// Creates a decoder with the sensor's noise.
    ///
    /// # Errors
    /// Returns no error for a [`Fringe`].
    pub(super) fn decoder(&self, options: Options) -> Result<Decoder> {
        let options = Options {
            noise: Some(self.fringe.noise()),
            ..options
        };
        Decoder::new(&self.manifest, WIDTH, self.fringe.rows, None, options)
    }

    /// Returns the frames in the decoder's format.
    pub(super) fn images(&self) -> &[Image] {
        &self.images
    }
}

/// Returns a pattern's light at a column, from -1 to 1: fringes by their formula, Gray code as held
/// pixels averaged over a camera pixel.
fn level(pattern: &Pattern, x: f64) -> f64 {
    match pattern {
        Pattern::Fringe {
            period_px,
            phase_rad,
            ..
        } => (TAU * x / period_px + phase_rad).cos(),
        Pattern::Gray { .. } => {
            let (low, high) = (x - 0.5 * STEP_PX, x + 0.5 * STEP_PX);
            let columns = (low + 0.5).floor() as u32..=(high + 0.5).floor() as u32;
            let part = |i: u32| {
                let middle = f64::from(i);
                let overlap = (high.min(middle + 0.5) - low.max(middle - 0.5)).max(0.0);
                overlap * pattern.level(i).unwrap_or(0.0)
            };
            2.0 * columns.map(part).sum::<f64>() / STEP_PX - 1.0
        }
        uniform => 2.0 * uniform.level(0).unwrap_or(0.0) - 1.0,
    }
}
