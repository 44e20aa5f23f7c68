//! Frames that lack rows.
//!
//! What comes after lost rows moves up. Where a surface ends or a texture changes from row to row
//! nearly all frames change, and all of them at one place; from the lost rows on, the changes of one
//! frame are whole rows above those of the others. Points there would be of neither surface: the other
//! checks see few of them, for a Gray frame is wrong only where the code of both surfaces differs.
//!
//! Frames whose patterns vary down the image have changes of their own; they are left out.
//!
//! Something that moves shifts the frames as well, but each of them little more than the one before it.

use super::grid::{read_row, value};
use crate::protocol::Frame;
use crate::simd::widest;
use rayon::prelude::*;
use std::collections::HashMap;

/// Rows above and below a change that belong to it.
const REACH: usize = 4;
/// Rows that are looked for; the lack of more is seen by the other checks.
const MOST_ROWS: usize = 3;
/// Part of the range of its pixels that a frame has to change by.
const LOUD: f32 = 0.2;
/// Frames that have to change so for all of them to be compared: more than the steps of one fringe, which
/// change along a slope too.
const LEAST_FRAMES: usize = 5;
/// No noise is a change: so many deviations of it, from one row to the next,
const SIGMAS: f32 = 6.0;
/// and what is less than so many is left out of a sum.
const FLOOR_SIGMAS: f32 = 3.0;
/// A change is so many rows above the others when it is so near to that,
const NEAR: f32 = 0.35;
/// and speaks against it twice when it is no nearer than this.
const FAR: f32 = 0.65;
/// Columns and rows of a part of the image,
const CELL: usize = 16;
/// of whose changes so many are asked: they are likely to be of one edge, which may be odd.
const OF_ONE: u32 = 2;
/// Changes that have to speak for lost rows, less those that speak against them. Sound captures of five
/// built-in profiles before the scenes of a bench have at most half of it.
const LEAST: usize = 12;
/// Columns of an image that are looked at, at most.
const COLUMNS: usize = 640;
/// Rows that are looked at as one.
const BAND: usize = 32;

/// A change of a frame between rows.
#[derive(Clone, Copy)]
struct Change {
    frame: usize,
    row: usize,
    /// Which part of the image it is in.
    cell: (usize, usize),
    /// By how many rows it is above the same change of the other frames.
    above: f32,
}

/// From a row on a frame looks as if it were some rows above the others.
struct Tail {
    row: usize,
    votes: usize,
}

/// Whether a frame is whole rows above the others, from some row on. Frames are of one size; `down` are
/// those that vary down the image.
pub(super) fn check(frames: &[Frame], down: &[bool], noise_dn: f32) -> Result<(), String> {
    let mut changes = vec![Vec::new(); frames.len()];
    for change in changes_of(frames, down, noise_dn) {
        changes[change.frame].push(change);
    }
    for (frame, own) in changes.iter().enumerate() {
        for rows in 1..=MOST_ROWS {
            let Some(tail) = tail(own, rows) else {
                continue;
            };
            let before = frame.checked_sub(1).and_then(|before| changes.get(before));
            let mut beside = before.into_iter().chain(changes.get(frame + 1));
            if beside.all(|other| follows(other, rows, tail.row)) {
                continue;
            }
            return Err(format!(
                "frame {frame} is {rows} row{} above the others from about row {} on, at {} places: \
                 rows are missing, or something moved",
                if rows == 1 { "" } else { "s" },
                tail.row,
                tail.votes
            ));
        }
    }
    Ok(())
}

/// The rows from which on most changes are so many rows above the others; none where too few are.
fn tail(changes: &[Change], rows: usize) -> Option<Tail> {
    let (mut votes, mut against) = (0, 0);
    let mut found: Option<Tail> = None;
    let mut asked: HashMap<(usize, usize), u32> = HashMap::new();
    for change in changes.iter().rev() {
        let of_one = asked.entry(change.cell).or_default();
        *of_one += 1;
        if *of_one > OF_ONE {
            continue;
        }
        let off = (change.above - rows as f32).abs();
        votes += usize::from(off < NEAR);
        against += 2 * usize::from(off > FAR);
        let ahead = votes.saturating_sub(against);
        if ahead >= found.as_ref().map_or(LEAST, |found| found.votes + 1) {
            found = Some(Tail {
                row: change.row,
                votes: ahead,
            });
        }
    }
    found
}

/// Whether a frame, too, is above the others by more than half of so many rows, from some row on.
fn follows(changes: &[Change], rows: usize, from: usize) -> bool {
    let tail = changes.iter().filter(|change| change.row >= from);
    let (mut for_it, mut all) = (0, 0);
    for change in tail {
        for_it += usize::from(change.above > 0.5 * rows as f32);
        all += 1;
    }
    2 * for_it > all
}

/// The changes of each frame in which others change too, from the first row to the last.
fn changes_of(frames: &[Frame], down: &[bool], noise_dn: f32) -> Vec<Change> {
    let Some((width, height)) = frames
        .first()
        .map(|f| (f.width as usize, f.height as usize))
    else {
        return Vec::new();
    };
    if height < 2 * REACH + 2 {
        return Vec::new();
    }
    let view = View {
        frames,
        down,
        width,
        noise_dn,
        stride: width.div_ceil(COLUMNS).max(1),
    };
    let totals = view.totals(height - 1);
    let columns = view.columns();
    let row = |row: usize| -> Vec<Change> {
        let at = |row: usize| &totals[row * columns..][..columns];
        let least = LEAST_FRAMES as f32 * (SIGMAS - FLOOR_SIGMAS) * noise_dn;
        let is_edge = |column: &usize| {
            let total = at(row)[*column];
            // What most pixels fail first.
            total >= least
                && (row - REACH..row).all(|row| at(row)[*column] < total)
                && (row + 1..=row + REACH).all(|row| at(row)[*column] <= total)
        };
        let edges = (0..columns).filter(is_edge);
        edges.flat_map(|column| view.edge(row, column)).collect()
    };
    let rows = REACH..height - 1 - REACH;
    rows.into_par_iter().flat_map_iter(row).collect()
}

/// Frames, of which only some columns are looked at.
struct View<'a> {
    frames: &'a [Frame],
    down: &'a [bool],
    width: usize,
    noise_dn: f32,
    stride: usize,
}

impl View<'_> {
    fn columns(&self) -> usize {
        self.width.div_ceil(self.stride)
    }

    /// How much a frame changes, beyond noise.
    fn beyond(&self, change: f32) -> f32 {
        beyond(change, FLOOR_SIGMAS * self.noise_dn)
    }

    /// What belongs to frames whose patterns do not vary down the image, of what belongs to each.
    fn steady<'b, T>(&'b self, of_each: &'b [T]) -> impl Iterator<Item = &'b T> {
        let each = of_each.iter().zip(self.down);
        each.filter(|(_, down)| !**down).map(|(own, _)| own)
    }

    /// How much frames change from each row to the next, rows by columns.
    fn totals(&self, rows: usize) -> Vec<f32> {
        let columns = self.columns();
        let mut totals = vec![0f32; rows * columns];
        let bands = totals.par_chunks_mut(BAND * columns).enumerate();
        bands.for_each(|(band, totals)| {
            let (mut upper, mut lower) = (Vec::new(), Vec::new());
            for frame in self.steady(self.frames) {
                read_row(frame, band * BAND, self.stride, &mut upper);
                for (row, totals) in totals.chunks_mut(columns).enumerate() {
                    read_row(frame, band * BAND + row + 1, self.stride, &mut lower);
                    add(totals, &upper, &lower, FLOOR_SIGMAS * self.noise_dn);
                    std::mem::swap(&mut upper, &mut lower);
                }
            }
        });
        totals
    }

    /// Where each frame changes about a row of a column, beside where the others do; nothing where few
    /// frames change.
    fn edge(&self, row: usize, column: usize) -> Vec<Change> {
        const ROWS: usize = 2 * REACH + 2;
        let at = row * self.width + column * self.stride;
        let least = SIGMAS * self.noise_dn;
        let more =
            |frame: &&Frame| (value(frame, at + self.width) - value(frame, at)).abs() > least;
        if self.steady(self.frames).filter(more).count() < LEAST_FRAMES {
            return Vec::new();
        }
        let first = row - REACH;
        let read = |frame: &Frame| -> [f32; ROWS] {
            std::array::from_fn(|r| value(frame, (first + r) * self.width + column * self.stride))
        };
        let seen: Vec<[f32; ROWS]> = self.frames.iter().map(read).collect();
        let range = (0..ROWS).fold(0f32, |range, r| {
            let values = seen.iter().map(|frame| frame[r]);
            let low = values.clone().fold(f32::INFINITY, f32::min);
            range.max(values.fold(0.0, f32::max) - low)
        });
        let loud = (LOUD * range).max(SIGMAS * self.noise_dn);
        let changes = self
            .steady(&seen)
            .filter(|frame| (frame[REACH + 1] - frame[REACH]).abs() > loud);
        if changes.count() < LEAST_FRAMES {
            return Vec::new();
        }
        // Sum of the changes, and of the rows of each from the middle one.
        let moments = |frame: &[f32; ROWS]| {
            let beyond = frame.windows(2).map(|pair| self.beyond(pair[1] - pair[0]));
            let rows = beyond.enumerate();
            rows.fold((0.0, 0.0), |(sum, first), (r, change)| {
                (sum + change, first + change * (r as f32 - REACH as f32))
            })
        };
        let moments: Vec<(f32, f32)> = seen.iter().map(moments).collect();
        let sum: f32 = self.steady(&moments).map(|(sum, _)| sum).sum();
        let told = self.steady(&moments).filter(|(sum, _)| *sum > loud);
        let mut places: Vec<f32> = told.map(|(sum, first)| first / sum).collect();
        if places.is_empty() {
            return Vec::new();
        }
        // The middle one, for every second frame may lack rows.
        let middle = places.len() / 2;
        let usual = *places.select_nth_unstable_by(middle, f32::total_cmp).1;
        let of_frame = |(frame, own): (usize, &(f32, f32))| {
            let tells = !self.down[frame] && own.0 > loud && sum - own.0 > 2.0 * loud;
            tells.then(|| Change {
                frame,
                row,
                cell: (row / CELL, column / CELL),
                above: usual - own.1 / own.0,
            })
        };
        moments.iter().enumerate().filter_map(of_frame).collect()
    }
}

/// How much a change is more than noise may be.
#[inline(always)]
fn beyond(change: f32, floor: f32) -> f32 {
    let more = change.abs() - floor;
    if more > 0.0 { more } else { 0.0 }
}

widest! {
    /// Adds how much pixels of two rows differ.
    fn add(totals: &mut [f32], upper: &[f32], lower: &[f32], floor: f32) => add_body
}

#[inline(always)]
fn add_body(totals: &mut [f32], upper: &[f32], lower: &[f32], floor: f32) {
    for ((total, a), b) in totals.iter_mut().zip(upper).zip(lower) {
        *total += beyond(a - b, floor);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::PixelFormat;

    const SIZE: (usize, usize) = (64, 80);

    /// Blocks of brightness, each frame with its own, `up(frame, row)` rows above where they belong.
    fn frames(up: impl Fn(usize, usize) -> usize) -> Vec<Frame> {
        let (width, height) = SIZE;
        let picture = |frame: usize| {
            let pixel = |at: usize| {
                let (x, y) = (at % width, at / width);
                let block = (y + up(frame, y)) / 11 * 43 + x / 8 * 17 + frame * 13;
                (20 + block * 37 % 190) as u8
            };
            (0..width * height).map(pixel).collect()
        };
        let frame = |k: usize| Frame {
            id: k as u64,
            pattern_index: None,
            width: width as u32,
            height: height as u32,
            format: PixelFormat::Grey,
            exposure_start_ns: 0,
            exposure_end_ns: 0,
            data: picture(k),
        };
        (0..8).map(frame).collect()
    }

    #[test]
    fn rows_that_one_frame_lacks_are_told_and_named() {
        assert_eq!(check(&frames(|_, _| 0), &[false; 8], 0.5), Ok(()));
        for bad in [0, 3, 7] {
            for rows in 1..=MOST_ROWS {
                let lost = frames(|frame, row| rows * usize::from(frame == bad && row >= 30));
                let told = check(&lost, &[false; 8], 0.5).unwrap_err();
                let wanted = format!("frame {bad} is {rows} row");
                assert!(told.starts_with(&wanted), "{wanted}: {told}");
            }
        }
    }

    #[test]
    fn rows_that_every_second_frame_lacks_are_told() {
        for rows in 1..=MOST_ROWS {
            let lost =
                frames(|frame, row| rows * usize::from(frame % 2 == 1 && frame < 6 && row >= 30));
            let told = check(&lost, &[false; 8], 0.5).unwrap_err();
            assert!(
                told.starts_with(&format!("frame 1 is {rows} row")),
                "{told}"
            );
        }
    }

    #[test]
    fn what_moves_on_from_frame_to_frame_lacks_no_rows() {
        assert_eq!(
            check(&frames(|frame, _| frame / 2), &[false; 8], 0.5),
            Ok(())
        );
    }
}
