//! Greyscale images for the corner search: invalid pixels filled in, smoothed, or halved in size.

use crate::board::BoardImage;
use glam::DVec2;
use rayon::prelude::*;

/// A greyscale image with invalid pixels filled in, and its per-pixel noise.
pub(super) struct Grey {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) level: Vec<f32>,
    /// Standard deviation of a pixel's noise.
    pub(super) noise: f32,
}

/// Factor by which [`Grey::smoothed`] reduces the standard deviation of white noise.
pub(super) const SMOOTHED: f32 = 70.0 / 256.0;

impl Grey {
    /// Converts an image. Invalid pixels become as light as the lightest, because they are
    /// saturated. The noise is the 90th percentile of the pixels' noise.
    pub(super) fn of(image: &BoardImage) -> Self {
        let size = image.width.saturating_mul(image.height);
        if image.level.len() != size || image.variance.len() != size {
            return Self {
                width: 0,
                height: 0,
                level: Vec::new(),
                noise: 0.0,
            };
        }
        let finite = image.level.iter().copied().filter(|v| v.is_finite());
        let lightest = finite.fold(0.0_f32, f32::max).min(1e12);
        let fill = |&v: &f32| {
            if v.is_finite() {
                v.clamp(-1e12, 1e12)
            } else {
                lightest
            }
        };
        let stride = (size / 10_000).max(1);
        let mut variances: Vec<f32> = image.variance.iter().step_by(stride).copied().collect();
        variances.retain(|v| *v > 0.0 && v.is_finite());
        variances.sort_by(f32::total_cmp);
        let noise = variances.get(variances.len() * 9 / 10).copied();
        Self {
            width: image.width,
            height: image.height,
            level: image.level.iter().map(fill).collect(),
            noise: noise.unwrap_or(0.0).sqrt(),
        }
    }

    /// Halves the numbers of columns and rows; each pixel is the mean of four.
    pub(super) fn halved(&self) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let mut level = vec![0.0; width * height];
        if width > 0 {
            level
                .par_chunks_mut(width)
                .enumerate()
                .for_each(|(y, out)| {
                    let rows = &self.level[2 * y * self.width..][..2 * self.width];
                    let (a, b) = rows.split_at(self.width);
                    for (x, v) in out.iter_mut().enumerate() {
                        *v = 0.25 * (a[2 * x] + a[2 * x + 1] + b[2 * x] + b[2 * x + 1]);
                    }
                });
        }
        Self {
            width,
            height,
            level,
            noise: 0.5 * self.noise,
        }
    }

    /// Smooths with the binomial kernel 1 4 6 4 1 in both directions, which approximates a Gaussian
    /// with a standard deviation of one pixel.
    pub(super) fn smoothed(&self) -> Self {
        let (w, h) = (self.width, self.height);
        let mut across = vec![0.0; w * h];
        let mut level = vec![0.0; w * h];
        if w > 0 && h > 0 {
            let binomial = |a: f32, b: f32, c: f32, d: f32, e: f32| {
                (a + e) * 0.0625 + (b + d) * 0.25 + c * 0.375
            };
            across
                .par_chunks_mut(w)
                .zip(self.level.par_chunks(w))
                .for_each(|(out, row)| {
                    let at = |x: usize, by: isize| row[x.saturating_add_signed(by).min(w - 1)];
                    for x in 0..w {
                        out[x] = if x >= 2 && x + 2 < w {
                            binomial(row[x - 2], row[x - 1], row[x], row[x + 1], row[x + 2])
                        } else {
                            binomial(at(x, -2), at(x, -1), row[x], at(x, 1), at(x, 2))
                        };
                    }
                });
            level.par_chunks_mut(w).enumerate().for_each(|(y, out)| {
                let row = |by: isize| &across[y.saturating_add_signed(by).min(h - 1) * w..][..w];
                let (a, b, c, d, e) = (row(-2), row(-1), row(0), row(1), row(2));
                for x in 0..w {
                    out[x] = binomial(a[x], b[x], c[x], d[x], e[x]);
                }
            });
        }
        Self {
            width: w,
            height: h,
            level,
            noise: self.noise * SMOOTHED,
        }
    }

    /// Interpolates the level bilinearly; `None` outside the image.
    pub(super) fn between(&self, p: DVec2) -> Option<f32> {
        let inside = p.x >= 0.0
            && p.y >= 0.0
            && p.x < self.width as f64 - 1.0
            && p.y < self.height as f64 - 1.0;
        if !inside {
            return None;
        }
        let (x, y) = (p.x as usize, p.y as usize);
        let (fx, fy) = ((p.x - x as f64) as f32, (p.y - y as f64) as f32);
        let at = y * self.width + x;
        let rows =
            [at, at + self.width].map(|i| self.level[i] + fx * (self.level[i + 1] - self.level[i]));
        Some(rows[0] + fy * (rows[1] - rows[0]))
    }
}
