//! Frames whose rows are of two exposures.
//!
//! From one row to the next a sound frame hardly changes, but where a Gray code's edge passes, a
//! surface ends or a texture does; the last two change other frames too. A frame that is torn changes
//! along a whole row, and alone. So one pair of rows tells it, however few rows are below.

use super::grid::{full_scale, value};
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

/// What a column has seen of the frames.
#[derive(Clone, Copy)]
struct Seen {
    low: f32,
    high: f32,
    /// The frame that changes most, by how much, and how much the next one does.
    frame: usize,
    most: f32,
    second: f32,
}

/// Whether some frame changes along a row in which no other does. Frames are of one size.
pub(super) fn check(frames: &[Frame], noise_dn: f32) -> Result<(), String> {
    let Some((width, height)) = frames
        .first()
        .map(|f| (f.width as usize, f.height as usize))
    else {
        return Ok(());
    };
    let stride = width.div_ceil(COLUMNS).max(1);
    let full = full_scale(
        (0..width * height)
            .step_by(61)
            .flat_map(|at| frames.iter().map(move |frame| value(frame, at))),
    );
    let torn = |row: usize| {
        let columns = columns(frames, [(row - 1) * width, row * width], (width, stride));
        let mut counts = vec![0usize; frames.len()];
        let mut lit = 0;
        for seen in columns {
            let range = seen.high - seen.low;
            let quiet = (QUIET * range).max(SIGMAS * noise_dn);
            // A pixel at full scale has no range to speak of.
            if range <= 2.0 * quiet || seen.high >= full {
                continue;
            }
            lit += 1;
            if seen.most > (LOUD * range).max(2.0 * quiet) && seen.second < quiet {
                counts[seen.frame] += 1;
            }
        }
        let (frame, count) = counts.into_iter().enumerate().max_by_key(|(_, n)| *n)?;
        let much = count >= LEAST && count as f64 > SHARE * lit as f64;
        much.then_some((frame, row))
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
                (seen.most, seen.frame) = (change, number);
            } else {
                seen.second = seen.second.max(change);
            }
        }
    }
    columns
}
