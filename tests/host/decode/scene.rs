//! Frames of a known scene, and the errors of the result of decoding them.

use phasmid::decode::{Decoded, Decoder, Options, Verdict};
use phasmid::geometry::NoiseModel;
use phasmid::pattern::{Axis, Image, Manifest, Pattern};
use rayon::prelude::*;
use std::f64::consts::TAU;

pub const WIDTH: usize = 256;

/// A camera's response to a pattern: `floor + swing * level`, plus Gaussian noise, then rounding.
#[derive(Clone, Copy)]
pub struct Scene {
    pub floor: f64,
    pub swing: f64,
    /// Standard deviation of the noise in DN before rounding.
    pub noise: f64,
    /// Number of projector pixels that a camera pixel's footprint covers.
    pub footprint: f64,
    pub seed: u64,
}

impl Default for Scene {
    fn default() -> Self {
        Self {
            floor: 20.0,
            swing: 180.0,
            noise: 1.5,
            footprint: 4.0,
            seed: 1,
        }
    }
}

/// Returns a uniform number in (0, 1) that depends on a counter, by the finaliser of SplitMix64.
pub fn uniform(counter: u64) -> f64 {
    let mut z = counter.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 + 1e-17
}

pub fn normal(counter: u64) -> f64 {
    (-2.0 * uniform(2 * counter).ln()).sqrt() * (TAU * uniform(2 * counter + 1)).cos()
}

impl Scene {
    /// Returns the level of a pattern at a position. Fringes are a continuous function; Gray code is
    /// made of held projector pixels averaged over the footprint.
    fn level(&self, pattern: &Pattern, position: [f64; 2]) -> f64 {
        match *pattern {
            Pattern::Fringe {
                axis,
                period_px,
                phase_rad,
            } => 0.5 + 0.5 * (TAU * position[axis as usize] / period_px + phase_rad).cos(),
            Pattern::Gray { axis, .. } => {
                let x = position[axis as usize];
                let (lo, hi) = (x - 0.5 * self.footprint, x + 0.5 * self.footprint);
                let (mut sum, mut weight) = (0.0, 0.0);
                let mut i = (lo + 0.5).floor().max(0.0);
                while i - 0.5 < hi {
                    let overlap = (hi.min(i + 0.5) - lo.max(i - 0.5)).max(0.0);
                    sum += overlap * pattern.level(i as u32).unwrap();
                    weight += overlap;
                    i += 1.0;
                }
                sum / weight
            }
            ref uniform => uniform.level(0).unwrap(),
        }
    }

    pub fn frame(&self, index: usize, pattern: &Pattern, positions: &[[f64; 2]]) -> Vec<f64> {
        positions
            .iter()
            .enumerate()
            .map(|(i, &p)| {
                let counter = self.seed << 48 | (index as u64) << 32 | i as u64;
                let noise = if self.noise > 0.0 {
                    self.noise * normal(counter)
                } else {
                    0.0
                };
                self.floor + self.swing * self.level(pattern, p) + noise
            })
            .collect()
    }

    pub fn frames_u8(&self, manifest: &Manifest, positions: &[[f64; 2]]) -> Vec<Vec<u8>> {
        let frames = manifest.frame.par_iter().enumerate();
        frames
            .map(|(k, f)| self.frame(k, &f.pattern, positions))
            .map(|f| {
                f.iter()
                    .map(|v| v.round().clamp(0.0, 255.0) as u8)
                    .collect()
            })
            .collect()
    }

    pub fn noise_model(&self) -> NoiseModel {
        NoiseModel {
            gain_dn_per_e: 0.0,
            read_noise_dn: self.noise,
            black_level_dn: 0.0,
            saturation_dn: 255.0,
        }
    }

    pub fn options(&self) -> Options {
        Options {
            noise: Some(self.noise_model()),
            ..Options::default()
        }
    }

    pub fn decode(&self, manifest: &Manifest, positions: &[[f64; 2]], options: Options) -> Decoded {
        let frames = self.frames_u8(manifest, positions);
        let height = positions.len() / WIDTH;
        let decoder = Decoder::new(manifest, WIDTH, height, None, options).unwrap();
        let images: Vec<_> = frames
            .iter()
            .map(|f| Image::new(WIDTH, height, f.clone()).unwrap())
            .collect();
        decoder.decode(&images).unwrap()
    }
}

/// Returns positions on a smooth surface, over which x runs through its range with every sub-pixel
/// phase.
pub fn sweep(height: usize) -> Vec<[f64; 2]> {
    (0..WIDTH * height)
        .map(|i| {
            let (u, v) = ((i % WIDTH) as f64, (i / WIDTH) as f64);
            let x = 10.0 + 7.37 * u + 3.0 * (v * 0.11).sin() + 0.0317 * v;
            [x, 5.0 + 8.3 * v + 0.21 * u]
        })
        .collect()
}

/// Error figures, each for its own cause: coverage, rate of errors above `gross` among the valid
/// pixels, RMS of the other errors, and RMS of these errors relative to their own standard
/// deviations.
#[derive(Debug)]
pub struct Figures {
    pub coverage: f64,
    pub gross: f64,
    pub rms: f64,
    pub ratio: f64,
    pub sigma: f64,
}

pub fn figures(decoded: &Decoded, axis: Axis, positions: &[[f64; 2]], gross: f64) -> Figures {
    let map = decoded.axis(axis).unwrap();
    let (mut valid, mut wrong, mut squares, mut relative, mut sigmas) = (0, 0, 0.0, 0.0, 0.0);
    for (i, p) in positions.iter().enumerate() {
        assert_eq!(map.coordinate[i].is_nan(), map.verdict[i] != Verdict::Valid);
        assert_eq!(map.coordinate[i].is_nan(), map.sigma[i].is_nan());
        if map.coordinate[i].is_nan() {
            continue;
        }
        valid += 1;
        let error = f64::from(map.coordinate[i]) - p[axis as usize];
        if error.abs() > gross {
            wrong += 1;
            continue;
        }
        squares += error * error;
        relative += (error / f64::from(map.sigma[i])).powi(2);
        sigmas += f64::from(map.sigma[i]).powi(2);
    }
    let inliers = f64::from(valid - wrong).max(1.0);
    Figures {
        coverage: f64::from(valid) / positions.len() as f64,
        gross: f64::from(wrong) / f64::from(valid).max(1.0),
        rms: (squares / inliers).sqrt(),
        ratio: (relative / inliers).sqrt(),
        sigma: (sigmas / inliers).sqrt(),
    }
}

pub fn counts(decoded: &Decoded) -> [usize; Verdict::ALL.len()] {
    let mut counts = [0; Verdict::ALL.len()];
    for v in &decoded.axes().next().unwrap().1.verdict {
        counts[*v as usize] += 1;
    }
    counts
}
