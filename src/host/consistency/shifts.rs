//! The whole list of patterns against the lists that a single fault would have made of it.
//!
//! A pixel sees one point of the projector, so all frames that vary along an axis are one offset
//! and one contrast times what the patterns have at one coordinate. That ties sets of three steps,
//! references and Gray code together. For the list as asked, and for each list with one frame lost,
//! one shown twice or two neighbours exchanged, the best coordinate of each pixel is sought; the
//! capture is doubted where another list leaves far less unexplained, or explains as much with far
//! fewer jumps from pixel to pixel.

use super::grid::{Grid, Line, range};
use crate::decode::{AxisPlan, Order};
use crate::pattern::{Manifest, Pattern};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Pairs of pixels that are looked at, at most.
const PAIRS: usize = 160;
/// Pixels from one of a pair to the other.
const APART: usize = 8;
/// Coordinates that are tried in a period of the finest fringes.
const PER_PERIOD: f64 = 10.0;
/// They are no further apart, in projector pixels.
const STEP_PX: f64 = 2.0;
/// Patterns of a finer period are left out: a camera may blur them.
const FINE_PX: f64 = 10.0;
/// Coordinates that are tried, at most.
const COORDINATES: f64 = 8192.0;
/// A pixel's misfit counts up to this part of its squared range.
const CAP: f64 = 0.05;
/// Misfit below which nothing is doubted.
const GOOD: f64 = 2e-3;
/// Another list has to leave less than this part of the misfit.
const DISTINCT: f64 = 0.5;
/// Or, to be told by its jumps, no more than this many times the misfit.
const AS_GOOD: f64 = 1.1;
/// Pairs that have to speak for another list, in parts of all pairs.
const LEAST_PAIRS: f64 = 0.15;
/// And so many times as many as speak against it.
const MAJORITY: usize = 4;

/// A list of patterns by their numbers; `None` where it is not known what a frame shows.
struct List {
    what: String,
    shows: Vec<Option<usize>>,
}

/// What a list explains: the mean misfit and the coordinate of each pixel.
pub(super) struct Fit {
    pub(super) misfit: f64,
    /// Whether the list is a shifted one. Exchanged bits are told by `gray`.
    shifted: bool,
    coordinates: Vec<f64>,
}

/// Whether another list explains the frames distinctly better.
pub(super) fn check(manifest: &Manifest, axis: &AxisPlan, grid: &Grid) -> Result<(), String> {
    let pixels = pairs(grid);
    let levels = Levels::new(manifest, axis);
    let n = manifest.frame.len();
    let fit = |shows: &[Option<usize>]| levels.fit(shows, &pixels);
    let Some(asked) = fit(&(0..n).map(Some).collect::<Vec<_>>()) else {
        return Ok(());
    };
    // Without misfit and without jumps no other list can be found distinctly better.
    let jumps = !matches!(axis.order, Order::Wrapped { .. }) && jumpy(&asked, levels.finest);
    if asked.misfit <= GOOD && !jumps {
        return Ok(());
    }
    let others: Vec<(String, Fit)> = lists(n)
        .into_par_iter()
        .filter_map(|list| Some((list.what, fit(&list.shows)?)))
        .collect();
    let fits = others.iter().filter(|(_, other)| {
        asked.misfit > GOOD && other.misfit < DISTINCT * asked.misfit
            || jumps
                && other.shifted
                && other.misfit < AS_GOOD * asked.misfit.max(GOOD)
                && smoother(other, &asked, levels.finest)
    });
    match fits.min_by(|a, b| a.1.misfit.total_cmp(&b.1.misfit)) {
        Some((what, _)) => Err(what.clone()),
        None => Ok(()),
    }
}

/// Every list that a single fault makes.
fn lists(n: usize) -> Vec<List> {
    let mut all = Vec::new();
    for k in 0..n {
        all.push(List {
            what: format!("frame {k} looks lost"),
            shows: (0..n)
                .map(|i| if i < k { Some(i) } else { Some(i + 1) })
                .map(|shown| shown.filter(|shown| *shown < n))
                .collect(),
        });
        if k + 1 < n {
            all.push(List {
                what: format!("frame {k} looks repeated"),
                shows: (0..n).map(|i| Some(i - usize::from(i > k))).collect(),
            });
            let mut shows: Vec<_> = (0..n).map(Some).collect();
            shows.swap(k, k + 1);
            all.push(List {
                what: format!("frames {k} and {} look exchanged", k + 1),
                shows,
            });
        }
    }
    all
}

/// Whether so many pairs jump that another list could be smoother.
fn jumpy(asked: &Fit, finest: f64) -> bool {
    let pairs = asked.coordinates.chunks_exact(2);
    let all = pairs.len();
    let jump = pairs.filter(|pair| (pair[1] - pair[0]).abs() > finest);
    jump.count() as f64 > enough(all)
}

/// Pairs that have to speak for another list, of so many.
fn enough(pairs: usize) -> f64 {
    (LEAST_PAIRS * pairs as f64).max(4.0)
}

/// Whether pairs jump distinctly less.
fn smoother(other: &Fit, asked: &Fit, finest: f64) -> bool {
    let (mut speak_for, mut speak_against) = (0, 0);
    let pairs = other.coordinates.chunks_exact(2);
    let all = pairs.len();
    for (a, b) in pairs.zip(asked.coordinates.chunks_exact(2)) {
        let (tried, asked) = ((a[1] - a[0]).abs(), (b[1] - b[0]).abs());
        speak_for += usize::from(asked > 2.0 * tried + finest);
        speak_against += usize::from(tried > 2.0 * asked + finest);
    }
    speak_for as f64 > enough(all) && speak_for > MAJORITY * speak_against
}

/// The frames of pixels that vary, two and two from one neighbourhood.
fn pairs(grid: &Grid) -> Vec<&[f32]> {
    let ends = |line: &Line, i: usize| {
        i + APART < line.len() && line.varies[i..=i + APART].iter().all(|v| *v)
    };
    let starts: Vec<(&Line, usize)> = grid
        .lines
        .iter()
        .flat_map(|line| (0..line.len()).map(move |i| (line, i)))
        .filter(|(line, i)| ends(line, *i))
        .collect();
    starts
        .iter()
        .step_by(starts.len().div_ceil(PAIRS).max(1))
        .flat_map(|(line, i)| [line.pixel(*i), line.pixel(i + APART)])
        .collect()
}

/// What each pattern has at each coordinate that is tried.
pub(super) struct Levels {
    /// By pattern; `None` for pictures, patterns of the other axis and such as a camera may blur.
    rows: Vec<Option<Vec<f32>>>,
    step_px: f64,
    /// Least length in projector pixels that the patterns tell apart.
    finest: f64,
}

impl Levels {
    pub(super) fn new(manifest: &Manifest, axis: &AxisPlan) -> Self {
        let patterns = || manifest.frame.iter().map(|frame| &frame.pattern);
        let own = |pattern: &&Pattern| pattern.axis() == Some(axis.axis);
        let finest = patterns()
            .filter(own)
            .filter_map(resolved_px)
            .fold(axis.extent_px, f64::min);
        let step_px = (finest / PER_PERIOD)
            .min(STEP_PX)
            .max(axis.extent_px / COORDINATES);
        let count = (axis.extent_px / step_px).ceil() as usize;
        let row = |pattern: &Pattern| {
            let shown = match pattern.axis() {
                None => true,
                Some(a) => a == axis.axis && resolved_px(pattern).is_some(),
            };
            let at = |i: usize| level(pattern, i as f64 * step_px);
            shown.then(|| (0..count).map(at).collect()).flatten()
        };
        Self {
            rows: patterns().map(row).collect(),
            step_px,
            finest,
        }
    }

    /// `None` where a list leaves nothing to check.
    pub(super) fn fit(&self, shows: &[Option<usize>], pixels: &[&[f32]]) -> Option<Fit> {
        let known: Vec<(usize, &[f32])> = shows
            .iter()
            .enumerate()
            .filter_map(|(i, shown)| Some((i, self.rows[(*shown)?].as_deref()?)))
            .collect();
        let n = known.len();
        if n < 4 || pixels.is_empty() {
            return None;
        }
        let count = known[0].1.len();
        let (mut sums, mut squares) = (vec![0f32; count], vec![0f32; count]);
        for (_, row) in &known {
            for ((sum, square), t) in sums.iter_mut().zip(&mut squares).zip(*row) {
                *sum += t;
                *square += t * t;
            }
        }
        // Deviations of the patterns at each coordinate; next to none cannot be told from noise.
        let deviations: Vec<f32> = sums
            .iter()
            .zip(&squares)
            .map(|(sum, square)| square - sum * sum / n as f32)
            .collect();
        let mut misfit = 0.0;
        let mut products = vec![0f32; count];
        let coordinates = pixels
            .iter()
            .map(|pixel| {
                let mean = known.iter().map(|(i, _)| pixel[*i]).sum::<f32>() / n as f32;
                products.fill(0.0);
                let mut total = 0.0;
                for (i, row) in &known {
                    let v = pixel[*i] - mean;
                    total += v * v;
                    for (product, t) in products.iter_mut().zip(*row) {
                        *product += v * t;
                    }
                }
                let explained = |i: usize| match products[i] > 0.0 && deviations[i] > 1e-3 {
                    true => products[i] * products[i] / deviations[i],
                    false => 0.0,
                };
                let mut best = (0, 0.0);
                for i in 0..count {
                    let here = explained(i);
                    if here > best.1 {
                        best = (i, here);
                    }
                }
                let (low, high) = range(pixel);
                let scale = f64::from(high - low).powi(2).max(1.0) * (n - 3) as f64;
                misfit += (f64::from(total - best.1) / scale).clamp(0.0, CAP);
                best.0 as f64 * self.step_px
            })
            .collect();
        Some(Fit {
            misfit: misfit / pixels.len() as f64,
            shifted: shows.windows(2).any(|w| w[0] == w[1]) || shows.last() == Some(&None),
            coordinates,
        })
    }
}

/// Length in projector pixels that a pattern tells apart; `None` where it is so fine that a camera
/// may see little of it.
fn resolved_px(pattern: &Pattern) -> Option<f64> {
    let (period_px, length_px) = match *pattern {
        Pattern::Fringe { period_px, .. } => (period_px, period_px),
        Pattern::Gray { cell_px, bit, .. } => {
            let run_px = cell_px * f64::from(bit + 1).exp2();
            (2.0 * run_px, run_px)
        }
        _ => return None,
    };
    (period_px >= FINE_PX).then_some(length_px)
}

/// A pattern's level at a coordinate in projector pixels; none of a picture.
fn level(pattern: &Pattern, x: f64) -> Option<f32> {
    let level = match *pattern {
        Pattern::Fringe {
            period_px,
            phase_rad,
            ..
        } => 0.5 + 0.5 * (TAU * (x / period_px).fract() + phase_rad).cos(),
        _ => pattern.level(x.round() as u32)?,
    };
    Some(level as f32)
}
