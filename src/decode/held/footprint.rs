//! Measures the footprint of the camera's pixels on the projector's, and its blur, on a grid.
//!
//! At each node of the grid a parabola is fitted to a run of coordinates along a line of pixels. Its
//! slope is the width of the footprint. Its residuals contain the error of held pixels. The error
//! without blur is known ([`super::curve`]), and a regression of the residuals on that error gives the
//! fraction of it that remains after blur. The regression uses all harmonics, since at widths such as
//! 2/3 the harmonics look alike from pixel to pixel.

use super::curve::Footprint;
use super::posterior::Table;
use crate::maps::AxisMap;
use rayon::prelude::*;
use std::f32::consts::PI;

/// Side of the cells in which footprint and blur are measured, in pixels.
pub(super) const CELL: usize = 8;
/// Maximum distance in pixels over which changes along rows and columns are compared.
const FAR: usize = 8;
/// Minimum and maximum half length of a run in pixels.
const HALF: [usize; 2] = [6, 40];
/// Maximum length of a run in pixels.
const MOST: usize = 2 * HALF[1] + 1;
/// Minimum number of pixels of a run.
const LEAST: usize = 9;
/// Half length of a run in projector pixels: long enough for the parabola to average out the errors of
/// held projector pixels.
const PERIODS: f32 = 5.0;
/// Maximum half length, in pixels, of a run that is extended because its error repeats slowly.
const BEAT: f32 = 12.0;
/// Prior standard deviations of the fraction of the error that blur leaves: the first for the difference
/// of the whole image's fraction from 1, the second for the difference of a node's fraction from the
/// image's, since blur varies with depth.
const PRIOR: [f32; 2] = [0.5, 0.15];
/// A fraction above this counts as no blur. The blur is the square root of the fraction's logarithm,
/// which is steep near 1: an error of 0.005 in the fraction would give a blur of 0.016 px.
const SHARP: f32 = 0.95;
/// Distance in nodes, on either side, over which the fraction is averaged.
const REACH: usize = 2;
/// Minimum residual that is assumed for a run, in projector pixels: the model omits the rounding of the
/// pattern's levels, and light that differs within a pixel.
const MODEL_PX: f32 = 0.004;
/// Maximum relative change of the width between neighbouring nodes of a smooth surface.
const EVEN: f32 = 0.2;
/// Maximum residual of a run on a smooth surface, in projector pixels. Held pixels without blur have at
/// most 0.29.
const ROUGH_PX: f32 = 0.4;

/// An axis' map and how it is traversed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lines<'a> {
    pub(super) coordinate: &'a [f32],
    pub(super) sigma: &'a [f32],
    /// Columns and rows.
    pub(super) size: [usize; 2],
    /// Whether lines are columns, along which the coordinate changes more than along rows.
    pub(super) down: bool,
    /// Distance between neighbouring pixels, in pixel widths.
    pub(super) apart: f32,
    /// Period that coordinates are known modulo; infinite if they are absolute.
    pub(super) period: f32,
}

impl Lines<'_> {
    /// Returns the lines of a map along which the coordinate changes most.
    pub(super) fn of(map: &AxisMap, size: [usize; 2], apart: f32) -> Lines<'_> {
        let mut lines = Lines {
            coordinate: &map.coordinate,
            sigma: &map.sigma,
            size,
            down: false,
            apart,
            period: map.wrapped_px.map_or(f32::INFINITY, |px| px as f32),
        };
        let [w, h] = size;
        let mut votes = 0i64;
        let farthest = FAR.min(w.saturating_sub(1)).min(h.saturating_sub(1));
        for v in (0..h - farthest).step_by(23) {
            for u in (0..w - farthest).step_by(23) {
                let at = v * w + u;
                // Compares over several distances, since neighbours may lie on the same plateau of held
                // pixels.
                let change = |step: usize| -> f32 {
                    let far = |k| lines.less(lines.coordinate[at + k * step], lines.coordinate[at]);
                    (1..=farthest).map(|k| far(k).abs()).sum()
                };
                let (right, down) = (change(1), change(w));
                votes += i64::from(right >= down) - i64::from(right < down);
            }
        }
        lines.down = votes < 0;
        lines
    }

    /// The difference a - b, reduced to the nearest period.
    fn less(&self, a: f32, b: f32) -> f32 {
        let d = a - b;
        if self.period.is_finite() {
            d - self.period * (d / self.period).round()
        } else {
            d
        }
    }

    /// Fits a parabola around the pixel of a node; nodes are `cell` pixels apart.
    fn fit(&self, [u, v]: [usize; 2], cell: usize, table: &Table) -> Option<Fit> {
        let [w, h] = self.size;
        let at = v * w + u;
        let (step, place, length) = if self.down { (w, v, h) } else { (1, u, w) };
        let x = |k: isize| self.coordinate[at.wrapping_add_signed(k * step as isize)];
        if place < 2 || place + 2 >= length {
            return None;
        }
        let between = |k: isize| self.less(x(k), x(k - 1));
        let slope = 0.25 * (-1..=2).map(between).sum::<f32>();
        if !slope.is_finite() {
            return None;
        }
        let width = slope.abs();
        let half = half_run(width, HALF);
        // The coordinates relative to the node, towards either end until the surface ends.
        let mut run = [0.0; MOST];
        let jump = 1.5 + 1.5 * width;
        let mut reach = |sign: isize, room: usize| {
            let mut last = 0.0;
            for k in 1..=half.min(room) {
                let k_signed = sign * k as isize;
                let change = self.less(x(k_signed), x(k_signed - sign));
                // NaN ends the run as well.
                if !((change - sign as f32 * slope).abs() < jump) {
                    return k - 1;
                }
                last += change;
                run[HALF[1].wrapping_add_signed(k_signed)] = last;
            }
            half.min(room)
        };
        let (before, after) = (reach(-1, place), reach(1, length - 1 - place));
        let n = before + after + 1;
        if n < LEAST {
            return None;
        }
        let run = &mut run[HALF[1] - before..=HALF[1] + after];
        let parabola = Parabola::new(n);
        let [c0, c1, c2] = parabola.project(run);
        let sharp = table.sharp(width / self.apart);
        let mut waves = [0.0; MOST];
        let waves = &mut waves[..n];
        for (k, (value, wave)) in run.iter_mut().zip(&mut *waves).enumerate() {
            let fitted = parabola.at([c0, c1, c2], k as f32);
            *value -= fitted;
            *wave = sharp(x(0) + fitted);
        }
        let coefficients = parabola.project(waves);
        let (mut dot, mut square, mut rest) = (0.0, 0.0, 0.0);
        for (k, (value, wave)) in run.iter().zip(&*waves).enumerate() {
            let wave = wave - parabola.at(coefficients, k as f32);
            dot += value * wave;
            square += wave * wave;
            rest += value * value;
        }
        let rest = (rest - dot * dot / square.max(f32::MIN_POSITIVE)) / (n - 4) as f32;
        let sigma = self.sigma[at];
        if rest > (ROUGH_PX * ROUGH_PX).max(9.0 * sigma * sigma) {
            return None;
        }
        // Neighbouring runs share pixels; scaling the variance counts each pixel only once.
        let shared = (n as f32 / cell as f32).max(1.0);
        let variance = rest.max(0.1 * sigma * sigma).max(MODEL_PX * MODEL_PX) * shared;
        // If the period is not a whole number of pixels, a wrapped coordinate does not give the
        // position within a pixel.
        let place_known = !self.period.is_finite() || self.period.fract() == 0.0;
        let [dot, square] = [dot, square].map(|sum| f32::from(u8::from(place_known)) * sum);
        Some(Fit {
            value: x(0) + parabola.at([c0, c1, c2], before as f32),
            slope: parabola.slope([c0, c1, c2], before as f32).abs() / self.apart,
            dot: dot / variance,
            square: square / variance,
        })
    }
}

/// Returns the half length in pixels of a run in which the errors of held pixels average out, clamped
/// to the limits; `width` is the change of the coordinate from pixel to pixel.
pub(super) fn half_run(width: f32, [least, most]: [usize; 2]) -> usize {
    let mut half = PERIODS / width.max(0.01);
    // If the width is near a whole number of projector pixels, the error repeats slowly from pixel to
    // pixel.
    let beat = (width - width.round()).abs();
    if width > 0.5 {
        half = half.max((1.6 / beat.max(0.01)).min(BEAT));
    }
    (half.ceil() as usize).clamp(least, most)
}

/// Orthogonal polynomials of degree 0 to 2 over the integers 0 to n - 1.
struct Parabola {
    middle: f32,
    /// Mean of the squared distance from the middle.
    spread: f32,
    norms: [f32; 3],
}

impl Parabola {
    fn new(n: usize) -> Self {
        let n = n as f32;
        let spread = (n * n - 1.0) / 12.0;
        Self {
            middle: 0.5 * (n - 1.0),
            spread,
            norms: [n, n * spread, n * spread * (n * n - 4.0) / 15.0],
        }
    }

    /// Coefficients of the least-squares fit.
    fn project(&self, values: &[f32]) -> [f32; 3] {
        let mut sums = [0.0; 3];
        for (k, value) in values.iter().enumerate() {
            let t = k as f32 - self.middle;
            sums[0] += value;
            sums[1] += value * t;
            sums[2] += value * (t * t - self.spread);
        }
        std::array::from_fn(|i| sums[i] / self.norms[i])
    }

    fn at(&self, [c0, c1, c2]: [f32; 3], k: f32) -> f32 {
        let t = k - self.middle;
        c0 + c1 * t + c2 * (t * t - self.spread)
    }

    fn slope(&self, [_, c1, c2]: [f32; 3], k: f32) -> f32 {
        c1 + 2.0 * c2 * (k - self.middle)
    }
}

/// A parabola at a node.
#[derive(Debug, Clone, Copy)]
struct Fit {
    /// Coordinate in projector pixels.
    value: f32,
    /// Change of the coordinate along the line, in projector pixels per pixel width.
    slope: f32,
    /// Sums over the run of residual times wave, and (in `square`) of wave squared, both divided by the
    /// variance. The wave is the error without blur minus its parabola.
    dot: f32,
    square: f32,
}

/// Footprints on a grid of square cells.
#[derive(Debug)]
pub(super) struct Grid {
    /// Number of cells along a row.
    pub(super) columns: usize,
    /// Row by row; `None` where neither the cell nor one near it is on a smooth surface.
    pub(super) cells: Vec<Option<Footprint>>,
    /// True if the width is measured and no crease crosses the cell.
    pub(super) even: Vec<bool>,
    /// Whether the lines are columns.
    pub(super) down: bool,
    /// Distance between neighbouring pixels in pixel widths.
    pub(super) apart: f32,
}

impl Grid {
    /// Measures the footprints of a map.
    pub(super) fn new(lines: Lines<'_>, cell: usize, table: &Table) -> Self {
        let [columns, rows] = lines.size.map(|side| side.div_ceil(cell));
        let middle = |i: usize, side: usize| (i * cell + cell / 2).min(side - 1);
        let fits: Vec<Option<Fit>> = (0..columns * rows)
            .into_par_iter()
            .with_min_len(columns)
            .map(|i| {
                let [w, h] = lines.size;
                lines.fit(
                    [middle(i % columns, w), middle(i / columns, h)],
                    cell,
                    table,
                )
            })
            .collect();
        let raw: Vec<_> = (0..fits.len())
            .map(|i| fits[i].map(|fit| (fit, lines.across(&fits, [columns, rows], i, cell))))
            .collect();
        // The blur includes the width of the footprint across the lines.
        let sums: Vec<[f32; 2]> = raw
            .iter()
            .map(|raw| match raw {
                None => [0.0; 2],
                Some((fit, across)) => {
                    let strength = share_of(*across / 12f32.sqrt());
                    [fit.dot * strength, fit.square * strength * strength]
                }
            })
            .collect();
        let share = |[dot, square]: [f32; 2], before: f32, prior: f32| {
            let precision = prior.powi(-2);
            (dot + before * precision) / (square + precision)
        };
        let add = |a: [f32; 2], b: [f32; 2]| [a[0] + b[0], a[1] + b[1]];
        let whole = share(sums.iter().copied().fold([0.0; 2], add), 1.0, PRIOR[0]);
        let around = boxes(&sums, columns);
        let cells = raw
            .iter()
            .zip(&around)
            .map(|(raw, sums)| {
                let (fit, across) = (*raw)?;
                let local = share(*sums, whole, PRIOR[1]);
                Some(Footprint {
                    width: fit.slope,
                    blur: blur_of(local).hypot(across / 12f32.sqrt()),
                })
            })
            .collect();
        let even = (0..fits.len())
            .map(|i| lines.is_even(&fits, [columns, rows], i))
            .collect();
        let mut grid = Self {
            columns,
            cells,
            even,
            down: lines.down,
            apart: lines.apart,
        };
        for _ in 0..REACH {
            grid.fill();
        }
        grid
    }

    /// Gives each cell without a footprint the footprint of a neighbour.
    fn fill(&mut self) {
        let old = self.cells.clone();
        let columns = self.columns;
        for (i, cell) in self.cells.iter_mut().enumerate() {
            let column = i % columns;
            let left = (column > 0).then(|| i - 1);
            let right = (column + 1 < columns).then(|| i + 1);
            let near = [left, right, i.checked_sub(columns), Some(i + columns)];
            let near = near.into_iter().flatten();
            *cell = cell.or_else(|| near.filter_map(|i| *old.get(i)?).next());
        }
    }

    /// The footprint of the median width.
    pub(super) fn median(&self) -> Option<Footprint> {
        let mut all: Vec<_> = self.cells.iter().flatten().copied().collect();
        let middle = all.len() / 2;
        (!all.is_empty()).then(|| {
            *all.select_nth_unstable_by(middle, |a, b| a.width.total_cmp(&b.width))
                .1
        })
    }
}

impl Lines<'_> {
    /// Change of the coordinate across the lines at a node, in projector pixels per pixel width: the
    /// smaller of both sides, so that a step in depth does not count; 0 if unknown.
    fn across(
        &self,
        fits: &[Option<Fit>],
        [columns, rows]: [usize; 2],
        i: usize,
        cell: usize,
    ) -> f32 {
        let Some(here) = fits[i] else { return 0.0 };
        let slope =
            |there: Fit| self.less(there.value, here.value).abs() / (cell as f32 * self.apart);
        let sides = beside(fits, [columns, rows], i, !self.down).map(slope);
        let least = sides.fold(f32::INFINITY, f32::min);
        if least.is_finite() { least } else { 0.0 }
    }

    /// Returns true if the width at a node is measured and near the width at a neighbour along the line.
    /// At a crease it differs from the widths at both neighbours.
    fn is_even(&self, fits: &[Option<Fit>], size: [usize; 2], i: usize) -> bool {
        let Some(here) = fits[i] else { return false };
        let differs = |there: &Fit| (there.slope - here.slope).abs() > EVEN * here.slope;
        beside(fits, size, i, self.down).filter(differs).count() < 2
    }
}

/// The fits of both neighbours of a node in its row or column.
fn beside(
    fits: &[Option<Fit>],
    [columns, rows]: [usize; 2],
    i: usize,
    down: bool,
) -> impl Iterator<Item = Fit> {
    let (step, place, length) = match down {
        true => (columns, i / columns, rows),
        false => (1, i % columns, columns),
    };
    let before = (place > 0).then(|| fits[i - step]).flatten();
    let after = (place + 1 < length).then(|| fits[i + step]).flatten();
    before.into_iter().chain(after)
}

/// Sums over the boxes of nodes around each node.
fn boxes(sums: &[[f32; 2]], columns: usize) -> Vec<[f32; 2]> {
    let rows = sums.len() / columns.max(1);
    let range = |i: usize, n: usize| i.saturating_sub(REACH)..(i + REACH + 1).min(n);
    (0..sums.len())
        .map(|i| {
            let mut total = [0.0; 2];
            for row in range(i / columns, rows) {
                for column in range(i % columns, columns) {
                    let one = sums[row * columns + column];
                    total = [total[0] + one[0], total[1] + one[1]];
                }
            }
            total
        })
        .collect()
}

/// Share of the first harmonic that a blur leaves.
fn share_of(blur: f32) -> f32 {
    (-2.0 * PI * PI * blur * blur).exp()
}

/// The blur that leaves a share of the first harmonic.
fn blur_of(share: f32) -> f32 {
    if share > SHARP {
        0.0
    } else {
        // The lower bound of the share is a blur at which the error vanishes.
        (-share.max(1e-4).ln() / (2.0 * PI * PI)).sqrt()
    }
}
