//! Where frames change from row to row, each beside the others.
//!
//! Where a surface ends or a texture changes nearly all frames change, and all of them at one place.
//! Frames whose patterns vary down the image have changes of their own; they are left out.

use super::grid::{read_row, value};
use phasmid_core::simd::widest;
use phasmid_pattern::Image;
use rayon::prelude::*;

/// Rows above and below a change that belong to it.
const REACH: usize = 4;
/// Part of the range of its pixels that a frame has to change by.
const LOUD: f32 = 0.2;
/// Frames that have to change so for all of them to be compared: more than the steps of one fringe, which
/// change along a slope too.
const LEAST_FRAMES: usize = 5;
/// No noise is a change: so many deviations of it, from one row to the next,
const SIGMAS: f32 = 6.0;
/// and what is less than so many is left out of a sum.
const FLOOR_SIGMAS: f32 = 3.0;
/// Columns and rows of a part of the image.
const CELL: usize = 16;
/// Columns of an image that are looked at, at most.
const COLUMNS: usize = 640;
/// Rows that are looked at as one.
const BAND: usize = 32;

/// A change of a frame between rows.
#[derive(Clone, Copy)]
pub(super) struct Change {
    pub(super) frame: usize,
    pub(super) row: usize,
    /// Which part of the image it is in.
    pub(super) cell: (usize, usize),
    /// By how many rows it is above the same change of the other frames.
    pub(super) above: f32,
}

/// The changes of each frame in which others change too, from the first row to the last.
pub(super) fn changes_of(frames: &[Image], down: &[bool], noise_dn: f32) -> Vec<Change> {
    let Some((width, height)) = frames.first().map(|f| (f.width(), f.height())) else {
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
    frames: &'a [Image],
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
            |frame: &&Image| (value(frame, at + self.width) - value(frame, at)).abs() > least;
        if self.steady(self.frames).filter(more).count() < LEAST_FRAMES {
            return Vec::new();
        }
        let first = row - REACH;
        let read = |frame: &Image| -> [f32; ROWS] {
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
