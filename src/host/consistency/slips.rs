//! Fringe sets that are rows apart.
//!
//! The mean of a set's steps is a picture of the scene without fringes. Where a frame lacks rows, what
//! comes after them moves up, and with it the mean of its set, by the rows over the steps. `rows` tells one
//! frame among many by its edges; this tells sets by all that varies down the image, edges or shades, and
//! whichever of their frames lack rows. By how much pictures are apart is their difference over the
//! slope of the light (Lucas and Kanade: "An iterative image registration technique", IJCAI 1981).
//!
//! Something that moves takes the pictures apart as well, but on and on: of three sets in turn the middle
//! one is where the mean of the two others is. What it is off from there is no motion of a patient.

use super::grid::{full_scale, read_row, value};
use phasmid_decode::{AxisPlan, FringeSet};
use phasmid_pattern::Image;
use rayon::prelude::*;
use std::ops::Add;

/// Rows that the middle of three sets may be off, for motion is not quite even. A step of three that lacks a
/// row takes its set off by a third.
const MOST_ROWS: f64 = 0.05;
/// Deviations of its noise that it has to be off.
const SIGMAS: f64 = 6.0;
/// A slope has so many deviations of a sample's noise a row: four of its own, of nine samples above and
/// nine below.
const STEEP: f32 = 1.0;
/// Last rows that are left out: they are black where others are missing.
const LAST: usize = 4;
/// Columns that are looked at, at most.
const COLUMNS: usize = 160;
/// Rows that are looked at as one; tails begin with each.
const BAND: usize = 12;

/// Sums over pixels on slopes.
#[derive(Clone, Copy, Default)]
struct Sums {
    /// Of what the middle set is off, in DN, times the slope, in DN a row.
    cross: f64,
    /// Of the squares of slopes.
    slopes: f64,
    /// Of the squares of what it is off.
    squares: f64,
    pixels: f64,
}

impl Add for Sums {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            cross: self.cross + other.cross,
            slopes: self.slopes + other.slopes,
            squares: self.squares + other.squares,
            pixels: self.pixels + other.pixels,
        }
    }
}

impl Sums {
    /// Rows that the middle set is off, and their standard deviation.
    fn rows(&self) -> Option<(f64, f64)> {
        let rows = self.cross / self.slopes;
        let left = self.squares - rows * self.cross;
        let variance = left / (self.pixels - 1.0) / self.slopes;
        (self.pixels > 2.0 && variance.is_finite()).then(|| (rows, variance.max(0.0).sqrt()))
    }
}

/// Whether a set is rows off from those before and after it, from some row on.
pub(super) fn check(axis: &AxisPlan, frames: &[Image], noise_dn: f32) -> Result<(), String> {
    let mut sets: Vec<&FringeSet> = axis.sets.iter().collect();
    sets.sort_by_key(|set| set.frames.iter().copied().min());
    let Some(first) = frames.first().filter(|_| sets.len() > 2) else {
        return Ok(());
    };
    let steps = || sets.iter().flat_map(|set| &set.frames);
    let looked = (0..first.samples().len()).step_by(97);
    let full = full_scale(steps().flat_map(|k| looked.clone().map(|i| value(&frames[*k], i))));
    for three in sets.windows(3) {
        let sight = Sight {
            sets: [three[0], three[1], three[2]],
            frames,
            width: first.width(),
            stride: first.width().div_ceil(COLUMNS).max(1),
            steep_dn: STEEP * noise_dn,
            full,
        };
        let last = first.height().saturating_sub(LAST);
        let starts: Vec<usize> = (1..last.saturating_sub(1)).step_by(BAND).collect();
        let band = |start: &usize| sight.sums(*start, (start + BAND).min(last - 1));
        let bands: Vec<Sums> = starts.par_iter().map(band).collect();
        let mut tail = Sums::default();
        for (band, start) in bands.iter().zip(&starts).rev() {
            tail = tail + *band;
            let Some((rows, deviation)) = tail.rows() else {
                continue;
            };
            if rows.abs() > MOST_ROWS + SIGMAS * deviation {
                let [begin, end] = [three[0], three[2]].map(|set| &set.frames);
                return Err(format!(
                    "the fringes of frames {} to {} are {:.2} rows apart from about row {start} on: rows \
                     are missing",
                    begin[0],
                    end[end.len() - 1],
                    rows.abs()
                ));
            }
        }
    }
    Ok(())
}

/// Three sets, and where they are looked at.
struct Sight<'a> {
    sets: [&'a FringeSet; 3],
    frames: &'a [Image],
    width: usize,
    stride: usize,
    steep_dn: f32,
    full: f32,
}

/// Means of the three sets in a row, and the greatest sample.
type Row = ([Vec<f32>; 3], Vec<f32>);

impl Sight<'_> {
    fn row(&self, row: usize, samples: &mut Vec<f32>) -> Row {
        let columns = self.width.div_ceil(self.stride);
        let mut top = vec![0f32; columns];
        let means = self.sets.map(|set| {
            let mut mean = vec![0f32; columns];
            for (weights, frame) in set.weights.iter().zip(&set.frames) {
                read_row(&self.frames[*frame], row, self.stride, samples);
                let weight = weights[0] as f32;
                for ((mean, top), v) in mean.iter_mut().zip(&mut top).zip(samples.iter()) {
                    *mean += weight * v;
                    *top = top.max(*v);
                }
            }
            mean
        });
        (means, top)
    }

    /// Of rows from one to before another, neither the first nor the last of the image.
    fn sums(&self, from: usize, to: usize) -> Sums {
        let mut samples = Vec::new();
        let mut sums = Sums::default();
        let mut rows = (from - 1..=to).map(|row| self.row(row, &mut samples));
        let (Some(mut above), Some(mut here)) = (rows.next(), rows.next()) else {
            return sums;
        };
        for below in rows {
            let at = |(means, _): &Row, i: usize| means.each_ref().map(|mean| mean[i]);
            for (i, top) in here.1.iter().enumerate() {
                let [upper, lower] =
                    [&above, &below].map(|row| at(row, i).iter().sum::<f32>() / 3.0);
                let slope = 0.5 * (lower - upper);
                if slope.abs() < self.steep_dn || *top >= self.full {
                    continue;
                }
                let [before, middle, after] = at(&here, i);
                let off = f64::from(middle - 0.5 * (before + after));
                let slope = f64::from(slope);
                sums = sums
                    + Sums {
                        cross: off * slope,
                        slopes: slope * slope,
                        squares: off * off,
                        pixels: 1.0,
                    };
            }
            above = std::mem::replace(&mut here, below);
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_decode::Plan;
    use phasmid_pattern::Manifest;
    use std::f64::consts::TAU;

    const SIZE: (usize, usize) = (96, 80);

    /// Three steps of three periods on waves of brightness down the image, `up(frame, row)` rows above
    /// where they belong.
    fn said(up: impl Fn(usize, usize) -> f64) -> Option<String> {
        let (width, height) = SIZE;
        let mut text = "[projector]\nwidth_px = 912\nheight_px = 684\n".to_owned();
        let frame = |k: usize| {
            let (period, phase) = ([10.0, 96.0, 960.0][k / 3], TAU * (k % 3) as f64 / 3.0);
            text += &format!(
                "[[frame]]\npattern = {{ kind = \"fringe\", axis = \"x\", period_px = {period}, \
                 phase_rad = {phase} }}\n"
            );
            let value = |i: usize| {
                let (u, v) = ((i % width) as f64, i / width);
                let place = v as f64 + up(k, v);
                let noise = ((i * 9 + k) as u32).wrapping_mul(2_654_435_761) >> 16;
                let level = 0.5 + 0.4 * (TAU * (100.0 + 4.0 * u) / period + phase).cos();
                let albedo = 140.0 + 80.0 * (place / 7.0 + u / 20.0).sin();
                (10.0 + albedo * level + 3.0 * f64::from(noise) / 65_536.0) as u8
            };
            Image::new(
                width,
                height,
                (0..width * height).map(value).collect::<Vec<u8>>(),
            )
            .unwrap()
        };
        let frames: Vec<Image> = (0..9).map(frame).collect();
        let plan = Plan::new(&Manifest::parse(&text, "t").unwrap()).unwrap();
        check(&plan.axes[0], &frames, 0.9).err()
    }

    #[test]
    fn still_and_moving_scenes_pass() {
        assert_eq!(said(|_, _| 0.0), None);
        assert_eq!(said(|frame, _| 0.1 * frame as f64), None);
    }

    #[test]
    fn a_row_that_frames_lack_is_told() {
        let lacks: [&dyn Fn(usize) -> bool; 3] =
            [&|k| k == 4, &|k| k % 2 == 1, &|k| (3..6).contains(&k)];
        for (lacks, rows) in lacks.iter().zip([1.0 / 3.0, 1.0 / 3.0, 1.0]) {
            for from in [0, 40] {
                let up = |k: usize, row: usize| f64::from(u8::from(lacks(k) && row >= from));
                let words = said(up).unwrap();
                let (_, off) = words.split_once("are ").unwrap();
                let found: f64 = off.split_once(' ').unwrap().0.parse().unwrap();
                assert!((found / rows - 1.0).abs() < 0.3, "{words}");
            }
        }
    }
}
