//! Frames whose rows are of two exposures.
//!
//! From one row to the next a sound frame hardly changes, but where a Gray code's edge passes, a
//! surface ends or a texture does; the last two change other frames too. A frame that is torn changes
//! along a whole row, and alone. So one pair of rows tells it, however few rows are below.
//!
//! Patterns down the image change one frame along a row too, where a code has an edge, but all of it
//! from dark to bright or all of it from bright to dark. Rows of another pattern change it both ways,
//! and a frame of such a pattern has to change so. (As elsewhere here, the camera is not rolled against
//! the projector by much.)

use super::grid::{full_scale, value};
use crate::decode::Plan;
use crate::pattern::Axis;
use crate::protocol::Frame;
use rayon::prelude::*;

/// Columns of a row that are looked at, about.
const COLUMNS: usize = 320;
/// Part of a pixel's range that one frame has to change by,
const LOUD: f32 = 0.3;
/// and that no other may.
const QUIET: f32 = 0.15;
/// No noise is a change: so many deviations of it.
const SIGMAS: f32 = 6.0;
/// Part of a row's pixels that have to change so, in the same frame,
const SHARE: f64 = 0.25;
/// and how many at least.
const LEAST: usize = 16;
/// Part of a row's pixels that have to become brighter, and darker, of a pattern down the image.
const EACH_WAY: f64 = 0.05;

/// What a column has seen of the frames.
#[derive(Clone, Copy)]
struct Seen {
    low: f32,
    high: f32,
    /// The frame that changes most, by how much, and how much the next one does.
    frame: usize,
    most: f32,
    second: f32,
    /// Whether it becomes brighter.
    brighter: bool,
}

/// Whether some frame changes along a row in which no other does. Frames are of one size.
pub(super) fn check(plan: &Plan, frames: &[Frame], noise_dn: f32) -> Result<(), String> {
    let Some((width, height)) = frames
        .first()
        .map(|f| (f.width as usize, f.height as usize))
    else {
        return Ok(());
    };
    let mut down = vec![false; frames.len()];
    for axis in plan.axes.iter().filter(|axis| axis.axis == Axis::Y) {
        let sets = axis.sets.iter().flat_map(|set| set.frames.iter().copied());
        let bits = axis.gray.iter().flat_map(|code| &code.bits);
        let bits = bits.flat_map(|bit| [bit.plain, bit.inverse]).flatten();
        sets.chain(bits).for_each(|frame| down[frame] = true);
    }
    let stride = width.div_ceil(COLUMNS).max(1);
    let full = full_scale(
        (0..width * height)
            .step_by(61)
            .flat_map(|at| frames.iter().map(move |frame| value(frame, at))),
    );
    let torn = |row: usize| {
        let columns = columns(frames, [(row - 1) * width, row * width], (width, stride));
        let mut counts = vec![[0usize; 2]; frames.len()];
        let mut lit = 0u32;
        for seen in columns {
            let range = seen.high - seen.low;
            let quiet = (QUIET * range).max(SIGMAS * noise_dn);
            // A pixel at full scale has no range to speak of.
            if range <= 2.0 * quiet || seen.high >= full {
                continue;
            }
            lit += 1;
            if seen.most > (LOUD * range).max(2.0 * quiet) && seen.second < quiet {
                counts[seen.frame][usize::from(seen.brighter)] += 1;
            }
        }
        let part = |count: usize| count as f64 / f64::from(lit);
        let is_torn = |(frame, ways): (usize, &[usize; 2])| {
            let both = ways[0] + ways[1];
            both >= LEAST
                && part(both) > SHARE
                && (!down[frame] || ways.iter().all(|way| part(*way) > EACH_WAY))
        };
        let frame = counts.iter().enumerate().position(is_torn)?;
        Some((frame, row))
    };
    match (1..height).into_par_iter().filter_map(torn).min() {
        None => Ok(()),
        Some((frame, row)) => Err(format!(
            "frame {frame} changes from row {} to row {row}, and no other does: its rows are of two \
             exposures",
            row - 1
        )),
    }
}

/// Two rows' pixels, by where the rows begin.
fn columns(
    frames: &[Frame],
    [above, below]: [usize; 2],
    (width, stride): (usize, usize),
) -> Vec<Seen> {
    let nothing = Seen {
        low: f32::INFINITY,
        high: f32::NEG_INFINITY,
        frame: 0,
        most: 0.0,
        second: 0.0,
        brighter: false,
    };
    let mut columns = vec![nothing; width.div_ceil(stride)];
    for (number, frame) in frames.iter().enumerate() {
        for (seen, x) in columns.iter_mut().zip((0..width).step_by(stride)) {
            let (upper, lower) = (value(frame, above + x), value(frame, below + x));
            let change = (lower - upper).abs();
            seen.low = seen.low.min(upper);
            seen.high = seen.high.max(upper);
            if change > seen.most {
                seen.second = seen.most;
                (seen.most, seen.frame, seen.brighter) = (change, number, lower > upper);
            } else {
                seen.second = seen.second.max(change);
            }
        }
    }
    columns
}
