//! The steps of a fringe set against other orders of them.

use super::grid::Grid;
use super::moments::{Moments, rest};
use phasmid_decode::{AxisPlan, FringeSet};

/// Pixels that are looked at, at most.
const PIXELS: usize = 5000;
/// Another order has to leave less than this part of the residual.
const DISTINCT: f64 = 0.8;
/// The lack of a frame has to leave less than this part of the residual that is to be expected.
const DISTINCT_LACK: f64 = 0.6;
/// Steps from which on a single bad one is told by its lack.
const LEAST_STEPS: usize = 6;
/// Part of the variance that fringes may leave unexplained.
const UNEXPLAINED: f64 = 0.35;

/// Whether another order, or one frame less, makes a set's residual distinctly smaller.
pub(super) fn check(axis: &AxisPlan, grid: &Grid) -> Result<(), String> {
    let pixels = grid.sample(PIXELS);
    let all = pixels.first().map_or(0, |pixel| pixel.len());
    for set in axis.sets.iter().filter(|set| set.frames.len() > 3) {
        let mut involved = set.frames.clone();
        involved.extend(set.frames.iter().flat_map(|f| strangers(set, *f, all)));
        involved.sort_unstable();
        involved.dedup();
        let moments = Moments::of(involved, &pixels);
        let asked = moments.residual(&rest(&[set]), &set.frames);
        if let Some((one, other)) = better_order(set, &moments, all, asked) {
            return Err(format!("frames {one} and {other} look exchanged"));
        }
        if let Some(bad) = worthless(set, &moments, asked) {
            return Err(format!("frame {bad} is no step of its fringes"));
        }
        if asked > UNEXPLAINED * moments.variance(&set.frames) {
            let (first, last) = (set.frames[0], set.frames[set.frames.len() - 1]);
            return Err(format!(
                "frames {first} to {last} are no fringes of one period in their order"
            ));
        }
    }
    Ok(())
}

/// Frames beside one of a set that are none of it, of so many in all.
fn strangers(set: &FringeSet, frame: usize, all: usize) -> impl Iterator<Item = usize> {
    [frame.checked_sub(1), frame.checked_add(1)]
        .into_iter()
        .flatten()
        .filter(move |other| *other < all && !set.frames.contains(other))
}

/// The two frames whose exchange explains the samples best, if distinctly better than no exchange:
/// any two steps, or a step and a frame beside it that is none.
fn better_order(
    set: &FringeSet,
    moments: &Moments,
    all: usize,
    asked: f64,
) -> Option<(usize, usize)> {
    let rest = rest(&[set]);
    let mut best = (DISTINCT * asked, None);
    for (place, &frame) in set.frames.iter().enumerate() {
        let others = set.frames[place + 1..].iter().copied();
        for other in others.chain(strangers(set, frame, all)) {
            let exchanged: Vec<usize> = set
                .frames
                .iter()
                .map(|&f| match f {
                    f if f == frame => other,
                    f if f == other => frame,
                    f => f,
                })
                .collect();
            let left = moments.residual(&rest, &exchanged);
            if left < best.0 {
                best = (left, Some((frame.min(other), frame.max(other))));
            }
        }
    }
    best.1
}

/// The frame without which the others fit far better.
fn worthless(set: &FringeSet, moments: &Moments, asked: f64) -> Option<usize> {
    let n = set.frames.len();
    if n < LEAST_STEPS {
        return None;
    }
    let expected = asked * (n - 4) as f64 / (n - 3) as f64;
    let mut best = (DISTINCT_LACK * expected, None);
    for lacking in 0..n {
        let (mut frames, mut phases) = (set.frames.clone(), set.phases.clone());
        let frame = frames.remove(lacking);
        phases.remove(lacking);
        let Ok(others) = FringeSet::new("steps", set.period_px, frames, phases) else {
            continue;
        };
        let left = moments.residual(&rest(&[&others]), &others.frames);
        if left < best.0 {
            best = (left, Some(frame));
        }
    }
    best.1
}
