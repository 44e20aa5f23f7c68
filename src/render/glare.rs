//! Veiling glare: spreads a fraction of the light over the whole image with a wide Gaussian.
//!
//! The blur is computed on a coarse grid whose cells are a quarter to an eighth of its standard
//! deviation wide: mean of each cell, separable Gaussian, bilinear interpolation. Averaging and
//! interpolation add variances of 1/12 and 1/6 of a squared cell width, which are subtracted from
//! the variance of the Gaussian. Light that would fall outside the image is reflected into it, so
//! the total is preserved exactly.

use phasmid_profile as profile;
use rayon::prelude::*;

/// Distance, in standard deviations, at which the Gaussian is truncated.
const REACH: f64 = 4.0;
/// Maximum cell size in pixels, so that an image has several cells.
const LARGEST_CELL: usize = 64;

/// Returns the standard deviations of the Gaussian along columns and rows in pixels; `aspect` is the
/// width of a pixel over its height.
pub(super) fn sigmas_px(glare: &profile::Glare, aspect: f64) -> [f64; 2] {
    [glare.sigma_px, glare.sigma_px * aspect]
}

/// Applies glare to a frame of mean electrons. `width` is the number of pixels per row; `aspect` is
/// the width of a pixel over its height.
pub(super) fn spread(electrons: &mut [f32], width: usize, glare: &profile::Glare, aspect: f64) {
    let share = (glare.percent / 100.0) as f32;
    if share == 0.0 || electrons.is_empty() {
        return;
    }
    let sigmas = sigmas_px(glare, aspect);
    let grid = Grid::new(electrons, width, cell_px(sigmas)).blurred(sigmas);
    let total = sum(electrons);
    let rows: Vec<Vec<f32>> = electrons
        .par_chunks(width)
        .enumerate()
        .map(|(row, _)| grid.row(row, width))
        .collect();
    let spread: f64 = rows.iter().map(|row| sum(row)).sum();
    let share_kept = if spread > 0.0 { total / spread } else { 0.0 } as f32 * share;
    electrons
        .par_chunks_mut(width)
        .zip(&rows)
        .for_each(|(electrons, scattered)| {
            for (e, s) in electrons.iter_mut().zip(scattered) {
                *e = *e * (1.0 - share) + share_kept * s;
            }
        });
}

/// Returns the approximate cell size in pixels for a Gaussian with these standard deviations in
/// pixels.
fn cell_px([across, down]: [f64; 2]) -> usize {
    let sigma_px = across.min(down);
    let mut cell = 8;
    while cell < LARGEST_CELL && (8 * cell) as f64 <= sigma_px {
        cell *= 2;
    }
    cell
}

fn sum(values: &[f32]) -> f64 {
    values.iter().map(|&e| f64::from(e)).sum()
}

/// Means over the cells; a whole number of cells covers the image.
struct Grid {
    width: usize,
    height: usize,
    /// Width and height of a cell in pixels, which are generally fractional.
    pitch: [f64; 2],
    values: Vec<f32>,
}

impl Grid {
    fn new(electrons: &[f32], width: usize, cell: usize) -> Self {
        let height = electrons.len() / width;
        let ([columns, rows], pitch) = cells([width, height], cell);
        let covered: Vec<_> = (0..columns).map(|c| cover(c, pitch[0], width)).collect();
        let values: Vec<f32> = (0..rows)
            .into_par_iter()
            .flat_map_iter(|row| {
                let mut means = vec![0.0; columns];
                let (from, weights) = cover(row, pitch[1], height);
                let lines = electrons[from * width..].chunks(width);
                for (line, weight) in lines.zip(weights) {
                    for (mean, (from, weights)) in means.iter_mut().zip(&covered) {
                        let cell = line[*from..].iter().zip(weights);
                        *mean += weight * cell.map(|(e, w)| e * w).sum::<f32>();
                    }
                }
                means
            })
            .collect();
        Self {
            width: columns,
            height: rows,
            pitch,
            values,
        }
    }

    fn blurred(mut self, sigmas_px: [f64; 2]) -> Self {
        let most = self.width.max(self.height);
        let [across, down] = [0, 1].map(|k| kernel(sigmas_px[k] / self.pitch[k], most));
        self.values = self.along(&across, self.width, 1, self.height, self.width);
        self.values = self.along(&down, self.height, self.width, self.width, 1);
        self
    }

    /// Convolves `lines` lines, each of `length` values that are `step` apart; the starts of the
    /// lines are `next` apart.
    fn along(
        &self,
        kernel: &[f64],
        length: usize,
        step: usize,
        lines: usize,
        next: usize,
    ) -> Vec<f32> {
        let weights = folded(kernel, length);
        let mut out = self.values.clone();
        for line in 0..lines {
            let values: Vec<f64> = (0..length)
                .map(|i| f64::from(self.values[line * next + i * step]))
                .collect();
            for (place, weights) in weights.chunks(length).enumerate() {
                let sum: f64 = weights.iter().zip(&values).map(|(w, v)| w * v).sum();
                out[line * next + place * step] = sum as f32;
            }
        }
        out
    }

    /// Returns a row of pixels, interpolated between the centres of the cells.
    fn row(&self, row: usize, width: usize) -> Vec<f32> {
        let (top, bottom, down) = between(row, self.pitch[1], self.height);
        let line = |r: usize| &self.values[r * self.width..(r + 1) * self.width];
        let mixed: Vec<f32> = line(top)
            .iter()
            .zip(line(bottom))
            .map(|(a, b)| a + down * (b - a))
            .collect();
        (0..width)
            .map(|column| {
                let (left, right, over) = between(column, self.pitch[0], self.width);
                mixed[left] + over * (mixed[right] - mixed[left])
            })
            .collect()
    }
}

/// Returns, for each axis, the number of cells of about `cell` pixels that cover the image, and
/// their exact width in pixels.
fn cells(size: [usize; 2], cell: usize) -> ([usize; 2], [f64; 2]) {
    let count = size.map(|side| side.div_ceil(cell));
    let pitch = std::array::from_fn(|axis| size[axis] as f64 / count[axis] as f64);
    (count, pitch)
}

/// Returns the Gaussian kernel for a standard deviation in cells. The variance that averaging and
/// interpolation add is subtracted from the variance of the Gaussian. `most` is the number of cells
/// along the longer side.
fn kernel(sigma: f64, most: usize) -> Vec<f64> {
    let variance = sigma.powi(2) - 1.0 / 12.0 - 1.0 / 6.0;
    // For a larger sigma the reflections make the result uniform, so sigma is limited.
    let most = 2.0 * most as f64;
    let sigma = variance.sqrt().min(most);
    let reach = (REACH * sigma).ceil() as usize;
    let bell = |k| (-0.5 * ((k as f64 - reach as f64) / sigma).powi(2)).exp();
    (0..=2 * reach).map(bell).collect()
}

/// Folds a kernel onto a line that reflects at both ends: for each position, returns the weights of
/// all `length` values.
fn folded(kernel: &[f64], length: usize) -> Vec<f64> {
    (0..length)
        .flat_map(|place| {
            let mut weights = vec![0.0; length];
            for (k, w) in kernel.iter().enumerate() {
                let at = place as i64 + k as i64 - (kernel.len() / 2) as i64;
                weights[reflected(at, length)] += w;
            }
            let whole: f64 = weights.iter().sum();
            weights.into_iter().map(move |w| w / whole)
        })
        .collect()
}

/// Precomputed tables along one axis, which are valid for all images of one size.
pub(super) struct Axis {
    pub(super) cells: usize,
    /// For each cell, the first pixel that it covers, and the weights of this pixel and the
    /// following ones.
    pub(super) covers: Vec<(usize, Vec<f32>)>,
    /// For each cell, the weights of all cells in the line.
    pub(super) weights: Vec<f64>,
    /// For each pixel, the cell before it and the fraction of the way to the next cell.
    pub(super) between: Vec<(usize, f32)>,
}

/// Returns the tables along columns and rows, for the GPU pass.
pub(super) fn axes(size: [usize; 2], sigmas_px: [f64; 2]) -> [Axis; 2] {
    let (counts, pitch) = cells(size, cell_px(sigmas_px));
    let most = counts[0].max(counts[1]);
    std::array::from_fn(|axis| {
        let (cells, pitch) = (counts[axis], pitch[axis]);
        let cover = |cell| cover(cell, pitch, size[axis]);
        let between = |pixel| {
            let (first, _, over) = between(pixel, pitch, cells);
            (first, over)
        };
        Axis {
            cells,
            covers: (0..cells).map(cover).collect(),
            weights: folded(&kernel(sigmas_px[axis] / pitch, most), cells),
            between: (0..size[axis]).map(between).collect(),
        }
    })
}

/// Returns the first pixel that a cell covers, and the weights of this pixel and the following ones.
fn cover(cell: usize, pitch: f64, pixels: usize) -> (usize, Vec<f32>) {
    let [from, to] = [cell, cell + 1].map(|c| (c as f64 * pitch).min(pixels as f64));
    let shares = (from as usize..to.ceil() as usize).map(|pixel| {
        let low = from.max(pixel as f64);
        let high = to.min(pixel as f64 + 1.0);
        ((high - low) / (to - from)) as f32
    });
    (from as usize, shares.collect())
}

/// Returns the cells on both sides of a pixel and the fraction of the way from the first to the
/// second.
fn between(pixel: usize, pitch: f64, cells: usize) -> (usize, usize, f32) {
    let at = ((pixel as f64 + 0.5) / pitch - 0.5) as f32;
    let at = at.max(0.0);
    let first = (at as usize).min(cells - 1);
    (first, (first + 1).min(cells - 1), at - first as f32)
}

/// Reflects an index at both ends of a line of `length` values; the end values are repeated.
fn reflected(at: i64, length: usize) -> usize {
    let period = 2 * length as i64;
    let at = at.rem_euclid(period);
    at.min(period - 1 - at) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_profile::Glare;

    const WIDTH: usize = 402;
    const HEIGHT: usize = 211;

    fn image() -> Vec<f32> {
        let mut image = vec![10.0; WIDTH * HEIGHT];
        for row in 60..90 {
            image[row * WIDTH + 120..row * WIDTH + 170].fill(9000.0);
        }
        image
    }

    /// Returns the integral over [a, b] of a Gaussian centred on `from` and reflected at 0 and
    /// `length`.
    fn share(from: f64, [a, b]: [f64; 2], length: f64, sigma: f64) -> f64 {
        let steps = 400;
        let h = (b - a) / f64::from(steps);
        let bell = |x: f64| (-0.5 * ((x - from) / sigma).powi(2)).exp();
        let folded = |x: f64| {
            let turns = [-4.0, -2.0, 0.0, 2.0, 4.0].map(|turn| turn * length);
            turns.map(|t| bell(t + x) + bell(t - x)).iter().sum::<f64>()
        };
        let middles = (0..steps).map(|k| folded(a + (f64::from(k) + 0.5) * h) * h);
        middles.sum::<f64>() / (sigma * std::f64::consts::TAU.sqrt())
    }

    /// Glare matches a reference: the Gaussian integrated over the bright rectangle and its
    /// reflections.
    #[test]
    fn glare_matches_the_integrated_gaussian() {
        for (sigma_px, aspect) in [
            (32.0, 1.0),
            (63.0, 1.0),
            (90.0, 1.0),
            (40.0, 2.0),
            (63.0, 0.8),
            (32.0, 0.5),
        ] {
            let before = image();
            let mut after = before.clone();
            let glare = Glare {
                percent: 8.0,
                sigma_px,
            };
            spread(&mut after, WIDTH, &glare, aspect);
            let mut worst = 0.0f64;
            let mut most = 0.0f64;
            for (row, column) in [
                (75, 145),
                (100, 145),
                (75, 200),
                (150, 300),
                (0, 0),
                (210, 140),
            ] {
                let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
                let scattered = 10.0
                    + 8990.0
                        * share(x, [120.0, 170.0], WIDTH as f64, sigma_px)
                        * share(y, [60.0, 90.0], HEIGHT as f64, aspect * sigma_px);
                let i = row * WIDTH + column;
                let expected = 0.92 * f64::from(before[i]) + 0.08 * scattered;
                worst = worst.max((f64::from(after[i]) - expected).abs());
                most = most.max(0.08 * scattered);
            }
            assert!(
                worst < 0.01 * most,
                "{sigma_px} {aspect}: {worst} of {most}"
            );
        }
    }

    #[test]
    fn glare_conserves_light() {
        for sigma_px in [32.0, 75.0, 3000.0] {
            let mut frame = image();
            let before = sum(&frame);
            let glare = Glare {
                percent: 30.0,
                sigma_px,
            };
            spread(&mut frame, WIDTH, &glare, 1.0);
            assert!((sum(&frame) / before - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn even_light_stays_even_and_darkness_dark() {
        for level in [0.0, 500.0] {
            let mut frame = vec![level; 37 * 19];
            let glare = Glare {
                percent: 100.0,
                sigma_px: 50.0,
            };
            spread(&mut frame, 37, &glare, 1.0);
            assert!(frame.iter().all(|e| (e - level).abs() <= 1e-4 * level));
        }
    }
}
