//! The whole list of patterns against the lists that a single fault would have made of it.
//!
//! What a list explains (`explained`) ties sets of three steps,
//! references and Gray code together. For the list as asked, and for each list with one frame lost,
//! one shown twice or two neighbours exchanged, the best coordinate of each pixel is sought; the
//! capture is doubted where another list leaves far less unexplained, or explains as much with far
//! fewer jumps from pixel to pixel.

use super::explained::{Fit, GOOD, Levels};
use super::grid::{Grid, Line};
use phasmid_decode::{AxisPlan, Order};
use phasmid_pattern::Manifest;
use rayon::prelude::*;

/// Pairs of pixels that are looked at, at most.
const PAIRS: usize = 160;
/// Pixels from one of a pair to the other.
const APART: usize = 8;
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

/// Whether another list explains the frames distinctly better.
pub(super) fn check(manifest: &Manifest, axis: &AxisPlan, grid: &Grid) -> Result<(), String> {
    let pixels = pairs(grid);
    let levels = Levels::new(manifest, axis, grid);
    let n = manifest.frame.len();
    let all: Vec<_> = (0..n).map(Some).collect();
    let Some(asked) = levels.fit(&all, &pixels, f64::INFINITY, true) else {
        return Ok(());
    };
    // Without misfit and without jumps no other list can be found distinctly better.
    let jumps = !matches!(axis.order, Order::Wrapped { .. }) && jumpy(&asked, levels.finest);
    let doubtful = asked.is_doubtful();
    if !doubtful && !jumps {
        return Ok(());
    }
    // A list that leaves more than this is not heard out.
    let by_misfit = if doubtful {
        DISTINCT * asked.misfit
    } else {
        0.0
    };
    let by_jumps = if jumps {
        AS_GOOD * asked.misfit.max(GOOD)
    } else {
        0.0
    };
    let most = by_misfit.max(by_jumps);
    let others: Vec<(String, Fit)> = lists(n)
        .into_par_iter()
        .filter_map(|list| Some((list.what, levels.fit(&list.shows, &pixels, most, jumps)?)))
        .collect();
    let fits = others.iter().filter(|(_, other)| {
        doubtful && other.misfit < DISTINCT * asked.misfit
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

/// Whether so many pairs jump, beyond what a smooth surface's pixels are apart, that another list could
/// be smoother.
fn jumpy(asked: &Fit, finest: f64) -> bool {
    let pairs = asked.coordinates.chunks_exact(2);
    let mut apart: Vec<f64> = pairs.map(|pair| (pair[1] - pair[0]).abs()).collect();
    apart.sort_by(f64::total_cmp);
    // Of coordinates at random a quarter is this near, and most are much farther apart than twice that.
    let smooth = apart.get(apart.len() / 4).copied().unwrap_or(0.0);
    let jump = apart.iter().filter(|apart| **apart > 2.0 * smooth + finest);
    jump.count() as f64 > enough(apart.len())
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
