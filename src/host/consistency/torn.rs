//! Frames whose rows are of two exposures.
//!
//! From one row to the next a sound frame hardly changes, but where a Gray code's edge passes, a
//! surface ends or a texture does; the last two change other frames too. A frame that is torn changes
//! along a whole row, and alone. So one pair of rows tells it, however few rows are below.
//!
//! Patterns down the image change one frame along a row too, where a code has an edge, but all of it
//! from dark to bright or all of it from bright to dark. Rows of another pattern change it both ways,
//! and a frame of such a pattern has to change so.
//!
//! Of two Gray frames that differ in few of the pixels that are seen, a tear changes few. So where a part
//! of a row changes alone, the frame is held against the one before and the one behind it: it is torn
//! if all that is above the row, or all that is below, is theirs.

use super::grid::{full_scale, read_row, value};
use phasmid_core::simd::widest;
use phasmid_pattern::Image;
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
/// which is enough of them if the rest of the image is another frame's,
const FEW: f64 = 0.06;
/// in all but so many pixels,
const NOT_THEIRS: f64 = 0.002;
/// and how many at least.
const LEAST: usize = 16;
/// Part of a row's pixels that have to become brighter, and darker, of a pattern down the image.
const EACH_WAY: f64 = 0.05;

/// Rows that are looked at as one.
const BAND: usize = 16;

/// What pixels have seen of the frames, each a list as long as there are pixels.
struct Seen {
    low: Vec<f32>,
    high: Vec<f32>,
    /// The frame that changes most, by how much, and how much the next one does.
    frame: Vec<u32>,
    most: Vec<f32>,
    second: Vec<f32>,
}

impl Seen {
    fn nothing(pixels: usize) -> Self {
        Self {
            low: vec![f32::INFINITY; pixels],
            high: vec![f32::NEG_INFINITY; pixels],
            frame: vec![0; pixels],
            most: vec![0.0; pixels],
            second: vec![0.0; pixels],
        }
    }

    /// What the pixels of a band of rows see from the row above each to it, in some columns.
    fn of_band(frames: &[Image], rows: std::ops::Range<usize>, every: usize) -> Self {
        let columns = frames
            .first()
            .map_or(0, |frame| frame.width().div_ceil(every));
        let mut seen = Self::nothing(rows.len() * columns);
        let (mut upper, mut lower) = (Vec::new(), Vec::new());
        for (number, frame) in frames.iter().enumerate() {
            read_row(frame, rows.start - 1, every, &mut upper);
            for (k, row) in rows.clone().enumerate() {
                read_row(frame, row, every, &mut lower);
                seen.add(number as u32, k * columns, &upper, &lower);
                std::mem::swap(&mut upper, &mut lower);
            }
        }
        seen
    }

    /// Adds a frame's pixels of two rows, from one of the lists' places on. Changes to the darker are
    /// negative.
    fn add(&mut self, number: u32, from: usize, upper: &[f32], lower: &[f32]) {
        let own = from..from + upper.len();
        let part = [
            &mut self.low,
            &mut self.high,
            &mut self.most,
            &mut self.second,
        ]
        .map(|list| &mut list[own.clone()]);
        add(number, [upper, lower], part, &mut self.frame[own]);
    }
}

widest! {
    /// See [`Seen::add`].
    fn add(number: u32, rows: [&[f32]; 2], part: [&mut [f32]; 4], frame: &mut [u32]) => add_body
}

/// Without branches, so that it vectorises.
#[inline(always)]
fn add_body(
    number: u32,
    [upper, lower]: [&[f32]; 2],
    [low, high, most, second]: [&mut [f32]; 4],
    frame: &mut [u32],
) {
    let n = frame.len();
    let (upper, lower) = (&upper[..n], &lower[..n]);
    let (low, high) = (&mut low[..n], &mut high[..n]);
    let (most, second) = (&mut most[..n], &mut second[..n]);
    // f32::min and f32::max take more, for numbers that are none.
    let larger = |a: f32, b: f32| if a > b { a } else { b };
    let smaller = |a: f32, b: f32| if a < b { a } else { b };
    for i in 0..n {
        let change = lower[i] - upper[i];
        low[i] = smaller(low[i], upper[i]);
        high[i] = larger(high[i], upper[i]);
        let (size, before) = (change.abs(), most[i].abs());
        let is_most = size > before;
        second[i] = larger(second[i], smaller(size, before));
        most[i] = if is_most { change } else { most[i] };
        frame[i] = if is_most { number } else { frame[i] };
    }
}

/// Whether some frame changes along a row in which no other does. Frames are of one size; `down` are
/// those that vary down the image.
pub(super) fn check(frames: &[Image], down: &[bool], noise_dn: f32) -> Result<(), String> {
    let Some((width, height)) = frames.first().map(|f| (f.width(), f.height())) else {
        return Ok(());
    };
    let every = width.div_ceil(COLUMNS).max(1);
    let columns = width.div_ceil(every);
    let full = full_scale(
        (0..width * height)
            .step_by(61)
            .flat_map(|at| frames.iter().map(move |frame| value(frame, at))),
    );
    let bands: Vec<usize> = (1..height).step_by(BAND).collect();
    let torn = |first: &usize| {
        let rows = *first..(first + BAND).min(height);
        let seen = Seen::of_band(frames, rows.clone(), every);
        let frame_of = |k: usize, row: usize| {
            let pixels = k * columns..(k + 1) * columns;
            let changed = changed(&seen, pixels, down, [noise_dn, full])?;
            let is_torn = changed.share > SHARE || is_anothers(frames, &changed, row, every);
            is_torn.then_some(changed.frame)
        };
        let mut found = rows
            .enumerate()
            .filter_map(|(k, row)| Some((frame_of(k, row)?, row)));
        found.next()
    };
    match bands
        .par_iter()
        .filter_map(torn)
        .min_by_key(|(_, row)| *row)
    {
        None => Ok(()),
        Some((frame, row)) => Err(format!(
            "frame {frame} changes from row {} to row {row}, and no other does: its rows are of two \
             exposures",
            row - 1
        )),
    }
}

/// A frame that changes alone from a row to the next.
struct Changed {
    frame: usize,
    /// In this part of the row's lit pixels,
    share: f64,
    /// by as much as this, at least, in DN.
    least: f32,
}

/// The frame that changes alone, along a row whose pixels have these places; some deviation of noise and
/// full scale in DN.
fn changed(
    seen: &Seen,
    row: std::ops::Range<usize>,
    down: &[bool],
    [noise_dn, full]: [f32; 2],
) -> Option<Changed> {
    let mut counts = vec![[0usize; 2]; down.len()];
    let mut least = vec![f32::INFINITY; down.len()];
    let mut lit = 0u32;
    for i in row {
        let range = seen.high[i] - seen.low[i];
        let quiet = (QUIET * range).max(SIGMAS * noise_dn);
        // A pixel at full scale has no range to speak of.
        if range <= 2.0 * quiet || seen.high[i] >= full {
            continue;
        }
        lit += 1;
        let most = seen.most[i];
        if most.abs() > (LOUD * range).max(2.0 * quiet) && seen.second[i] < quiet {
            let frame = seen.frame[i] as usize;
            counts[frame][usize::from(most > 0.0)] += 1;
            least[frame] = least[frame].min(most.abs());
        }
    }
    let part = |count: usize| count as f64 / f64::from(lit);
    let is_changed = |(frame, ways): &(usize, &[usize; 2])| {
        let both = ways[0] + ways[1];
        both >= LEAST
            && part(both) > FEW
            && (!down[*frame] || ways.iter().all(|way| part(*way) > EACH_WAY))
    };
    let by_count = |(_, ways): &(usize, &[usize; 2])| ways[0] + ways[1];
    let (frame, ways) = counts
        .iter()
        .enumerate()
        .filter(is_changed)
        .max_by_key(by_count)?;
    Some(Changed {
        frame,
        share: part(ways[0] + ways[1]),
        least: least[frame],
    })
}

/// Whether all that a frame has from a row on, or before it, is what the frame before it has, or the one
/// behind it: differences are less than half of what changes.
fn is_anothers(frames: &[Image], changed: &Changed, row: usize, every: usize) -> bool {
    let frame = &frames[changed.frame];
    let neighbours = [changed.frame.wrapping_sub(1), changed.frame + 1];
    let (mut own, mut theirs) = (Vec::new(), Vec::new());
    let mut is_theirs = |other: &Image, rows: std::ops::Range<usize>| {
        let (mut pixels, mut differ) = (0usize, 0usize);
        for row in rows {
            read_row(frame, row, every, &mut own);
            read_row(other, row, every, &mut theirs);
            let pairs = own.iter().zip(&theirs);
            differ += pairs
                .filter(|(a, b)| (*a - *b).abs() > 0.5 * changed.least)
                .count();
            pixels += own.len();
        }
        differ as f64 <= NOT_THEIRS * pixels as f64
    };
    let height = frame.height();
    neighbours
        .into_iter()
        .filter_map(|k| frames.get(k))
        .any(|other| is_theirs(other, row..height) || is_theirs(other, 0..row))
}
