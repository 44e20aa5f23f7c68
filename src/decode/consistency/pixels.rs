//! The samples of a part of each frame, and the fringes computed from them.

use crate::{FringeSet, Plan};
use phasmid_pattern::{Image, Samples};
use rayon::prelude::*;
use std::ops::Range;

/// Relative change of the light between neighbouring pixels above which an edge of a surface or colour
/// lies between them.
const STEP: f32 = 0.2;

/// The samples of the same rows in all frames, and the fringes computed from them.
pub(super) struct Pixels {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Samples in DN, by frame.
    levels: Vec<Vec<f32>>,
    /// The greatest sample of each frame.
    greatest: Vec<u16>,
    fringes: Vec<Fringes>,
    full: f32,
    /// Pixels at the camera's full scale in some frame.
    saturated: Vec<bool>,
}

/// Mean and both components of the fringes of one set in DN, by pixel.
pub(super) struct Fringes {
    frames: Vec<usize>,
    pub(super) mean: Vec<f32>,
    pub(super) cos: Vec<f32>,
    pub(super) sin: Vec<f32>,
}

/// Pixels in a row or column.
pub(super) struct Line {
    first: usize,
    step: usize,
    length: usize,
}

impl Line {
    pub(super) fn pixels(&self) -> impl Iterator<Item = usize> {
        (0..self.length).map(|i| self.first + i * self.step)
    }
}

impl Pixels {
    /// Reads some rows of frames of one size.
    pub(super) fn new(plan: &Plan, frames: &[Image], rows: &[Range<usize>]) -> Self {
        let width = frames.first().map_or(0, Image::width);
        let height = rows.iter().map(Range::len).sum();
        let of_frame = |frame: &Image| {
            let mut levels = Vec::with_capacity(width * height);
            let mut greatest = 0;
            for row in rows {
                let samples = row.start * width..row.end * width;
                let most = match frame.samples() {
                    Samples::U8(s) => taken(&s[samples], &mut levels),
                    Samples::U16(s) => taken(&s[samples], &mut levels),
                };
                greatest = greatest.max(most);
            }
            (levels, greatest)
        };
        let of_frames = frames.par_iter().map(of_frame);
        let (levels, greatest): (Vec<Vec<f32>>, Vec<u16>) = of_frames.unzip();
        let sets: Vec<&FringeSet> = plan.axes.iter().flat_map(|axis| &axis.sets).collect();
        let fringes = sets.into_par_iter().map(|set| Fringes::of(set, &levels));
        Self {
            width,
            height,
            fringes: fringes.collect(),
            full: f32::INFINITY,
            saturated: vec![false; width * height],
            greatest,
            levels,
        }
    }

    /// The greatest sample of all frames.
    pub(super) fn greatest(&self) -> u16 {
        self.greatest.iter().copied().max().unwrap_or(0)
    }

    /// Sets the camera's full scale in DN; infinite if it is not known.
    pub(super) fn set_full(&mut self, full: f32) {
        self.full = full;
        self.saturated = self.saturated_in(0..self.levels.len());
    }

    /// The pixels at the camera's full scale in one of these frames.
    pub(super) fn saturated_in(&self, frames: impl IntoIterator<Item = usize>) -> Vec<bool> {
        let mut greatest = vec![0.0f32; self.len()];
        let reaches = |frame: &usize| f32::from(self.greatest[*frame]) >= self.full;
        for frame in frames.into_iter().filter(reaches) {
            for (greatest, level) in greatest.iter_mut().zip(&self.levels[frame]) {
                *greatest = greatest.max(*level);
            }
        }
        greatest.iter().map(|level| *level >= self.full).collect()
    }

    /// Whether a pixel is at the camera's full scale in some frame.
    pub(super) fn is_saturated(&self, pixel: usize) -> bool {
        self.saturated[pixel]
    }

    /// All pixels at the camera's full scale.
    pub(super) fn saturated(&self) -> &[bool] {
        &self.saturated
    }

    /// Number of pixels.
    pub(super) fn len(&self) -> usize {
        self.saturated.len()
    }

    /// A frame's samples in DN.
    pub(super) fn frame(&self, frame: usize) -> &[f32] {
        &self.levels[frame]
    }

    /// The samples of all frames.
    pub(super) fn frames(&self) -> &[Vec<f32>] {
        &self.levels
    }

    /// The fringes of a set of the plan.
    pub(super) fn fringes(&self, set: &FringeSet) -> Option<&Fringes> {
        self.fringes.iter().find(|f| f.frames == set.frames)
    }

    /// Returns up to `most` equally spaced rows or columns.
    pub(super) fn lines(&self, along_rows: bool, most: usize) -> Vec<Line> {
        let (width, height) = (self.width, self.height);
        let (length, across, step, stride) = match along_rows {
            true => (width, height, 1, width),
            false => (height, width, width, 1),
        };
        let lines = most.min(across);
        let first = |line: usize| (2 * line + 1) * across / (2 * lines) * stride;
        let line = |line| Line {
            first: first(line),
            step,
            length,
        };
        (0..lines).map(line).collect()
    }

    /// Flags pixels that saturate in no frame and differ little in light from their neighbours in row
    /// and column.
    pub(super) fn plain(&self, plan: &Plan) -> Vec<bool> {
        // A difference counts only if all groups of frames show it: a damaged frame changes only one
        // group.
        let white = plan.white.map(|white| self.frame(white));
        let means = self.fringes.iter().map(|fringes| fringes.mean.as_slice());
        let mut lights: Vec<&[f32]> = white.into_iter().chain(means).collect();
        let second;
        if lights.len() < 2 {
            second = self.second_largest();
            lights.push(&second);
        }
        let like = |light: &[f32], i: usize, j: usize| {
            (light[i] - light[j]).abs() <= STEP * light[i].max(light[j])
        };
        let mut plain: Vec<bool> = self.saturated.iter().map(|saturated| !saturated).collect();
        let mut compare = |i: usize, j: usize| {
            if !lights.iter().any(|light| like(light, i, j)) {
                plain[i] = false;
                plain[j] = false;
            }
        };
        for row in 0..self.height {
            let row = row * self.width..(row + 1) * self.width;
            let below = row.end + self.width <= self.len();
            for i in row.clone() {
                if i + 1 < row.end {
                    compare(i, i + 1);
                }
                if below {
                    compare(i, i + self.width);
                }
            }
        }
        plain
    }

    /// The second largest sample of each pixel.
    fn second_largest(&self) -> Vec<f32> {
        let mut largest = vec![[0.0f32; 2]; self.len()];
        for level in &self.levels {
            for ([first, second], v) in largest.iter_mut().zip(level) {
                *second = second.max(first.min(*v));
                *first = first.max(*v);
            }
        }
        largest.into_iter().map(|[_, second]| second).collect()
    }
}

impl Fringes {
    fn of(set: &FringeSet, levels: &[Vec<f32>]) -> Self {
        let pixels = set.frames.first().map_or(0, |frame| levels[*frame].len());
        let [mut mean, mut cos, mut sin] = [const { Vec::new() }; 3].map(|mut sums: Vec<f32>| {
            sums.resize(pixels, 0.0);
            sums
        });
        for (frame, weights) in set.frames.iter().zip(&set.weights) {
            let [a, c, s] = weights.map(|weight| weight as f32);
            let sums = mean.iter_mut().zip(&mut cos).zip(&mut sin);
            for (((mean, cos), sin), level) in sums.zip(&levels[*frame]) {
                *mean += a * level;
                *cos += c * level;
                *sin += s * level;
            }
        }
        Self {
            mean,
            cos,
            sin,
            frames: set.frames.clone(),
        }
    }

    /// Both components of a pixel's fringe.
    pub(super) fn at(&self, pixel: usize) -> [f32; 2] {
        [self.cos[pixel], self.sin[pixel]]
    }
}

/// Appends samples in DN; returns the greatest.
fn taken<T: Copy + Ord + Default + Into<u16>>(samples: &[T], levels: &mut Vec<f32>) -> u16 {
    levels.extend(samples.iter().map(|v| f32::from((*v).into())));
    samples.iter().copied().max().unwrap_or_default().into()
}

/// Returns the `greatest` sample if it is the full scale of 8 to 16 bits, stored in the low or the high
/// bits of a word; infinity if it is not.
pub(super) fn full_scale(greatest: u16) -> f32 {
    let ones = greatest.count_ones();
    let is_end = greatest.trailing_ones() == ones || greatest.leading_ones() == ones;
    match ones >= 8 && is_end {
        true => f32::from(greatest),
        false => f32::INFINITY,
    }
}
