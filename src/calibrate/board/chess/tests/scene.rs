//! Renders a chessboard by ray casting through 4 x 4 subpixels per pixel, each with the mean level
//! of its small square, followed by blur and averaging over pixels.

use crate::board::BoardImage;
use glam::{DMat2, DVec2, DVec3};
use phasmid_geometry::{Board, Lens, NoiseModel, Pose};
use rayon::prelude::*;

/// Subpixels along a pixel's side.
const FINE: usize = 4;

pub struct Scene {
    pub board: Board,
    pub lens: Lens,
    pub camera_from_board: Pose,
    /// Standard deviation of the blur in pixels.
    pub blur: f64,
    /// Returns the level of white squares in DN at a position in the image.
    pub light: fn(DVec2) -> f64,
    /// Number of frames averaged; 0 renders without noise.
    pub frames: u32,
    pub seed: u64,
}

pub const NOISE: NoiseModel = NoiseModel {
    gain_dn_per_e: 0.0239,
    read_noise_dn: 0.055,
    black_level_dn: 0.0,
    saturation_dn: 255.0,
};

pub fn lens(width_px: u32, height_px: u32, distortion: [f64; 5]) -> Lens {
    Lens {
        width_px,
        height_px,
        focal_px: DVec2::splat(630.0),
        principal_px: DVec2::new(
            f64::from(width_px) / 2.0 - 3.3,
            f64::from(height_px) / 2.0 + 2.1,
        ),
        distortion,
    }
}

impl Scene {
    pub fn truth(&self, index: [u32; 2]) -> DVec2 {
        let point = self
            .camera_from_board
            .point(self.board.point(index).extend(0.0));
        self.lens.project(point).unwrap()
    }

    /// Position on the board under a pixel in units of squares; corners lie at integers.
    fn squares(&self, inverse: &Pose, px: DVec2) -> DVec2 {
        let (from, ray) = (
            inverse.point(DVec3::ZERO),
            inverse.direction(self.lens.ray(px)),
        );
        let hit = from - ray * (from.z / ray.z);
        let [columns, rows] = self.board.grid().map(f64::from);
        hit.truncate() / self.board.pitch_mm() + DVec2::new(columns - 1.0, rows - 1.0) / 2.0
    }

    /// Reflectance averaged over a subpixel, whose sides are 1 / FINE pixels long.
    fn white(&self, inverse: &Pose, px: DVec2) -> f64 {
        let at = self.squares(inverse, px);
        let h = 0.05;
        let by = DMat2::from_cols(
            self.squares(inverse, px + DVec2::X * h) - at,
            self.squares(inverse, px + DVec2::Y * h) - at,
        ) * (1.0 / h);
        let [columns, rows] = self.board.grid().map(f64::from);
        let inside = |margin: f64| {
            at.x > -margin
                && at.y > -margin
                && at.x < columns - 1.0 + margin
                && at.y < rows - 1.0 + margin
        };
        if !inside(2.0) {
            return 0.35;
        }
        if !inside(1.0) {
            return 0.9;
        }
        let wave = |f: f64, slope: DVec2| {
            let nearest = f.round();
            let sign = if nearest.rem_euclid(2.0) == 0.0 {
                1.0
            } else {
                -1.0
            };
            // Width of the subpixel perpendicular to an edge with this gradient.
            let across = (slope.x.abs() + slope.y.abs()) / FINE as f64;
            sign * (2.0 * (f - nearest) / across).clamp(-1.0, 1.0)
        };
        0.48 - 0.42 * wave(at.x, by.row(0)) * wave(at.y, by.row(1))
    }

    pub fn render(&self) -> BoardImage {
        let (width, height) = (self.lens.width_px as usize, self.lens.height_px as usize);
        let margin = (4.0 * self.blur).ceil() as usize + 1;
        let (w, h) = ((width + 2 * margin) * FINE, (height + 2 * margin) * FINE);
        let place = |i: usize| (i as f64 + 0.5) / FINE as f64 - 0.5 - margin as f64;
        let inverse = self.camera_from_board.inverse();
        let fine: Vec<f32> = (0..w * h)
            .into_par_iter()
            .map(|i| {
                let px = DVec2::new(place(i % w), place(i / w));
                (self.white(&inverse, px) * (self.light)(px)) as f32
            })
            .collect();
        let blurred = blur(
            &blur(&fine, w, self.blur * FINE as f64),
            h,
            self.blur * FINE as f64,
        );
        let mut random = Random(self.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
        let (mut level, mut variance) = (Vec::new(), Vec::new());
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let mut sum = 0.0;
            for (j, i) in (0..FINE).flat_map(|j| (0..FINE).map(move |i| (j, i))) {
                sum += f64::from(blurred[((y + margin) * FINE + j) * w + (x + margin) * FINE + i]);
            }
            let mean = sum / (FINE * FINE) as f64;
            let of_mean = NOISE.variance_dn2(mean) / f64::from(self.frames.max(1));
            let noise = if self.frames > 0 {
                of_mean.sqrt() * random.normal()
            } else {
                0.0
            };
            level.push((mean + noise) as f32);
            variance.push(of_mean as f32);
        }
        BoardImage {
            width,
            height,
            level,
            variance,
        }
    }
}

/// Blurs rows of `n` values and transposes the result.
fn blur(rows: &[f32], n: usize, sigma: f64) -> Vec<f32> {
    let reach = (4.5 * sigma).ceil() as usize;
    let weight =
        |k: usize| (-0.5 * (k as f64 - reach as f64).powi(2) / (sigma * sigma).max(1e-9)).exp();
    let kernel: Vec<f64> = (0..=2 * reach).map(weight).collect();
    let total: f64 = kernel.iter().sum();
    let kernel: Vec<f32> = kernel.iter().map(|k| (k / total) as f32).collect();
    let lines = rows.len() / n;
    let blurred: Vec<Vec<f32>> = rows
        .par_chunks(n)
        .map(|row| {
            let mut padded = vec![row[0]; reach];
            padded.extend(row);
            padded.resize(n + 2 * reach, row[n - 1]);
            let mut sum = vec![0.0; n];
            for (k, w) in kernel.iter().enumerate() {
                sum.iter_mut()
                    .zip(&padded[k..])
                    .for_each(|(s, v)| *s += w * v);
            }
            sum
        })
        .collect();
    let mut out = vec![0.0; rows.len()];
    for (line, row) in blurred.iter().enumerate() {
        for (i, v) in row.iter().enumerate() {
            out[i * lines + line] = *v;
        }
    }
    out
}

/// Marsaglia's xorshift.
pub struct Random(pub u64);

impl Random {
    pub fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}
