//! Correction with a smooth surface as prior knowledge ([`Held::Smooth`](super::Held::Smooth)).
//!
//! A local parabola through the coordinates along a line of pixels gives a smooth map S with a
//! standard deviation t, which follows from the noise and from how well S explains the decoded
//! coordinates x_d in each cell. With the error curve e of the cell's footprint, averaged over the
//! uncertainty of S as a further blur t,
//!
//! x = S + k (x_d - S - e(S)), k = g tau^2 / (g^2 tau^2 + sigma^2 + V), g = 1 + e'(S),
//!
//! where V is the variance of e that this average does not explain. tau is t, but at least [`WIDE`]
//! sigma, so that the noise itself is not smoothed where e changes little. On a plateau g is 0, and
//! x = S. Where S fits badly, t is large, e vanishes, and x = x_d.

use super::curve::{Footprint, POINTS, at};
use super::footprint::{CELL, Grid, Lines, half_run};
use super::posterior::{NEGLIGIBLE, Table};
use crate::maps::AxisMap;
use rayon::prelude::*;
use std::f32::consts::FRAC_PI_2;

/// Shortest and longest half window in pixels.
const HALF: [usize; 2] = [6, 40];
/// Smallest standard deviation of the prior, in standard deviations of the noise.
const WIDE: f32 = 3.0;
/// Smallest standard deviation of the smooth map in projector pixels: error of the footprint's model.
const MODEL_PX: f32 = 0.004;

/// A pixel of the smooth map.
#[derive(Debug, Clone, Copy)]
struct Smooth {
    /// Coordinate in projector pixels; NaN if too few pixels around are known.
    value: f32,
    /// Variance of `value` due to noise, relative to the noise variance of one pixel's coordinate.
    variance: f32,
}

/// Corrects a map whose `sampling` states the uncorrected error.
pub(super) fn correct(grid: &Grid, table: &Table, map: &mut AxisMap, width: usize) {
    let (windows, apart) = (windows(), grid.apart);
    let lines = Lines {
        coordinate: &map.coordinate,
        sigma: &map.sigma,
        size: [width, map.coordinate.len() / width],
        down: grid.down,
        apart,
        period: f32::INFINITY,
    };
    let smooth: Vec<Smooth> = (0..map.coordinate.len())
        .into_par_iter()
        .with_min_len(width)
        .map(|i| {
            let cell = i / width / CELL * grid.columns + i % width / CELL;
            match grid.cells[cell] {
                Some(footprint) => lines.smooth(i, footprint.width * apart, &windows),
                None => Smooth::NONE,
            }
        })
        .collect();
    let band = CELL * width;
    map.coordinate
        .par_chunks_mut(band)
        .zip(map.sigma.par_chunks_mut(band))
        .zip(map.sampling.par_chunks_mut(band))
        .zip(smooth.par_chunks(band))
        .enumerate()
        .for_each(|(row, (((coordinate, sigma), sampling), smooth))| {
            for column in 0..grid.columns {
                let cell = row * grid.columns + column;
                let Some(footprint) = grid.cells[cell].filter(|_| grid.even[cell]) else {
                    continue;
                };
                let pixels = || {
                    let columns = column * CELL..((column + 1) * CELL).min(width);
                    let rows = 0..smooth.len() / width;
                    rows.flat_map(move |v| columns.clone().map(move |u| v * width + u))
                };
                let seen = pixels().map(|i| (coordinate[i], sigma[i], smooth[i]));
                let Some(prior) = Prior::new(seen, footprint, table) else {
                    continue;
                };
                for i in pixels() {
                    let found = prior.estimate(coordinate[i], sigma[i], smooth[i]);
                    coordinate[i] = found.coordinate;
                    sigma[i] = found.noise;
                    sampling[i] = found.beyond_noise.hypot(table.rounding);
                }
            }
        });
}

impl Smooth {
    const NONE: Self = Self {
        value: f32::NAN,
        variance: f32::NAN,
    };
}

/// Tabulates half windows of all lengths. Each distance from the pixel has a squared cosine as weight,
/// times the powers 0 to 4 of the distance relative to the length.
fn windows() -> Vec<Vec<[f32; 5]>> {
    let weights = |half: usize| {
        let at = move |k: usize| {
            let place = k as f32 / (half + 1) as f32;
            let weight = (FRAC_PI_2 * place).cos().powi(2);
            std::array::from_fn(|n| weight * place.powi(n as i32))
        };
        (1..=half).map(at).collect()
    };
    (HALF[0]..=HALF[1]).map(weights).collect()
}

impl Lines<'_> {
    /// Fits a parabola to the pixels around pixel `i` of a surface along which the coordinate changes
    /// by about `width` per pixel. `windows` are from [`windows`].
    fn smooth(&self, i: usize, width: f32, windows: &[Vec<[f32; 5]>]) -> Smooth {
        let [w, h] = self.size;
        let (step, place, length) = if self.down {
            (w, i / w, h)
        } else {
            (1, i % w, w)
        };
        let half = half_run(width, HALF);
        let here = self.coordinate[i];
        // Moments of the weights and of the weighted coordinates relative to the pixel's.
        let (mut m, mut t) = ([0.0f32; 5], [0.0f32; 3]);
        m[0] = 1.0;
        let jump = 1.5 + 2.5 * width;
        let mut reach = |sign: f32, room: usize| {
            let (mut last, mut moments, mut sums) = (here, [0.0f32; 5], [0.0f32; 3]);
            for (k, weights) in windows[half - HALF[0]].iter().take(room).enumerate() {
                let apart = (k + 1) * step;
                let x = self.coordinate[if sign < 0.0 { i - apart } else { i + apart }];
                // NaN ends the window as well.
                if !((x - last).abs() < jump) {
                    break;
                }
                last = x;
                for (moment, weight) in moments.iter_mut().zip(weights) {
                    *moment += weight;
                }
                for (sum, weight) in sums.iter_mut().zip(weights) {
                    *sum += weight * (x - here);
                }
            }
            // Odd powers of the distance change sign.
            for n in 0..5 {
                let sign = if n % 2 == 0 { 1.0 } else { sign };
                m[n] += sign * moments[n];
                if let Some(t) = t.get_mut(n) {
                    *t += sign * sums[n];
                }
            }
        };
        reach(-1.0, place);
        reach(1.0, length - 1 - place);
        let [m0, m1, m2, m3, m4] = m.map(f64::from);
        let [t0, t1, t2] = t.map(f64::from);
        // Cramer's rule for the value at the pixel.
        let minor = m2 * m4 - m3 * m3;
        let (second, third) = (m1 * m4 - m2 * m3, m1 * m3 - m2 * m2);
        let determinant = m0 * minor - m1 * second + m2 * third;
        let variance = minor / determinant;
        // With weights of at most 1 used as if they were precisions, this is an upper bound of the
        // variance.
        if !(variance > 0.0 && variance < 1.0) {
            return Smooth::NONE;
        }
        Smooth {
            value: here + ((t0 * minor - t1 * second + t2 * third) / determinant) as f32,
            variance: variance as f32,
        }
    }
}

/// The error that a cell's footprint and smooth map predict for its coordinates.
struct Prior {
    /// The error at x = 0, 1 / `POINTS`, ... 1, blurred by the uncertainty of the smooth map.
    error: [f32; POINTS + 1],
    /// Variance of the smooth map, without the variance due to noise.
    misfit: f32,
    /// Variance of the error that the smooth map does not explain.
    unexplained: f32,
}

/// An estimate of a true coordinate.
struct Estimate {
    coordinate: f32,
    noise: f32,
    beyond_noise: f32,
}

impl Prior {
    /// Creates the prior of a cell from its decoded coordinates, their noise and the smooth map; `None`
    /// if one of these is missing or the error is negligible.
    fn new(
        pixels: impl Iterator<Item = (f32, f32, Smooth)>,
        footprint: Footprint,
        table: &Table,
    ) -> Option<Self> {
        let error = table.error(footprint);
        let (mut n, mut misfit, mut noise, mut of_smooth) = (0.0, 0.0, 0.0, 0.0);
        for (decoded, sigma, smooth) in pixels {
            let off = decoded - smooth.value - at(&error, smooth.value).0;
            n += 1.0;
            misfit += off * off - sigma * sigma;
            noise += sigma;
            of_smooth += sigma * sigma * smooth.variance;
        }
        let variance = error[..POINTS].iter().map(|e| e * e).sum::<f32>() / POINTS as f32;
        // Also rejects NaN.
        if !(misfit.is_finite() && variance.sqrt() > NEGLIGIBLE * noise / n) {
            return None;
        }
        let misfit = (misfit / n - table.rounding * table.rounding).max(0.0) + MODEL_PX * MODEL_PX;
        let spread = misfit + of_smooth / n;
        let error = table.error(Footprint {
            blur: footprint.blur.hypot(spread.sqrt()),
            ..footprint
        });
        let (mut squares, mut slopes) = (0.0, 0.0);
        for pair in error.windows(2) {
            squares += pair[0] * pair[0];
            slopes += ((pair[1] - pair[0]) * POINTS as f32).powi(2);
        }
        let unexplained = variance - (squares + slopes * spread) / POINTS as f32;
        Some(Self {
            error,
            misfit,
            unexplained: unexplained.max(0.0),
        })
    }

    fn estimate(&self, decoded: f32, sigma: f32, smooth: Smooth) -> Estimate {
        let (error, slope) = at(&self.error, smooth.value);
        let gain = 1.0 + slope;
        // Keeps the noise above 0, since `gain` is 0 on a plateau.
        let noise = (sigma * sigma).max(f32::MIN_POSITIVE);
        let of_smooth = noise * smooth.variance;
        let wide = (self.misfit + of_smooth).max(WIDE * WIDE * noise);
        let own = noise + self.unexplained;
        let k = gain * wide / (gain * gain * wide + own);
        let rest = (1.0 - k * gain).powi(2);
        Estimate {
            coordinate: smooth.value + k * (decoded - smooth.value - error),
            noise: (k * k * noise + rest * of_smooth).sqrt(),
            beyond_noise: (k * k * self.unexplained + rest * self.misfit).sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::curve::Curve;
    use super::super::{Footprints, Held};
    use super::*;

    const SIZE: [usize; 2] = [320, 64];
    const SIGMA: f32 = 0.02;
    const PERIOD: f64 = 16.0;

    /// Coordinates of a tilted surface with ripples of a period in pixels, decoded with held projector
    /// pixels and noise.
    fn ripples(width: f32, period: f32, amplitude: f32) -> (AxisMap, Vec<f32>) {
        let [columns, rows] = SIZE;
        let error = Curve::new(PERIOD, f64::from(width), 0.0).error;
        let truth: Vec<f32> = (0..columns * rows)
            .map(|i| {
                let [u, v] = [(i % columns) as f32, (i / columns) as f32];
                let ripple = (u / period * std::f32::consts::TAU).sin();
                100.0 + width * u + 0.031 * v + amplitude * ripple
            })
            .collect();
        // A sum of twelve uniform numbers is nearly normal.
        let mut state = 1u64;
        let mut noise = || {
            let mut uniform = || {
                state = state
                    .wrapping_mul(6364136223846793005)
                    .wrapping_add(1442695040888963407);
                (state >> 40) as f32 / (1u64 << 24) as f32
            };
            (0..12).map(|_| uniform()).sum::<f32>() - 6.0
        };
        let decoded = truth.iter().map(|x| x + at(&error, *x).0 + SIGMA * noise());
        let map = AxisMap {
            coordinate: decoded.collect(),
            sigma: vec![SIGMA; truth.len()],
            ..AxisMap::default()
        };
        (map, truth)
    }

    /// Fraction of the ripples' amplitude that is kept, and the RMS of error over standard uncertainty.
    fn kept(width: f32, period: f32, amplitude: f32, how: Held) -> [f32; 2] {
        let (mut map, truth) = ripples(width, period, amplitude);
        let table = Table::new(PERIOD, 0.0);
        let footprints = Footprints::new(&map, SIZE, 1.0, &table).unwrap();
        footprints.correct(&mut map, SIZE[0], how);
        let (mut dot, mut square, mut errors, mut n) = (0.0, 0.0, 0.0, 0.0);
        for i in (0..truth.len()).filter(|i| (40..280).contains(&(i % SIZE[0]))) {
            let u = (i % SIZE[0]) as f32;
            let ripple = (u / period * std::f32::consts::TAU).sin();
            let error = map.coordinate[i] - truth[i];
            dot += error * ripple;
            square += ripple * ripple;
            errors += (error / map.uncertainty(i)).powi(2);
            n += 1.0;
        }
        [1.0 + dot / square / amplitude, (errors / n).sqrt()]
    }

    #[test]
    fn prior_costs_ripples_of_few_pixels() {
        for width in [0.51, 0.77, 1.3] {
            for period in [6.0, 12.0, 24.0] {
                for amplitude in [0.05, 0.2] {
                    let of = |how| kept(width, period, amplitude, how);
                    let [own, smooth] = [Held::Correct, Held::Smooth].map(of);
                    let least = match (width < 0.6, period < 20.0) {
                        (true, true) => 0.5,
                        (false, true) => 0.7,
                        (_, false) => 0.93,
                    };
                    let place = format!("w {width} {period} px {amplitude}: {own:?} {smooth:?}");
                    assert!((own[0] - 1.0).abs() < 0.02, "{place}");
                    assert!((least..1.02).contains(&smooth[0]), "{place}");
                    // Ripples larger than the noise change the footprint's width, which the model takes
                    // as constant.
                    if amplitude < 0.1 || period > 20.0 {
                        assert!((0.75..1.15).contains(&smooth[1]), "{place}");
                    }
                }
            }
        }
    }
}
