//! The pixels that are looked at: whole lines of the image, along the axis of the patterns.

use phasmid_pattern::{Axis, Image, Samples};

/// Lines, evenly spread.
const LINES: usize = 64;
/// Pixels in a row that have to vary together: single ones are noise, text or a passing edge.
const RUN: usize = 8;
/// Every so manyth line tells the noise.
const NOISE_EVERY: usize = 4;
/// A pixel varies when its range over the frames is so many deviations of the noise wide.
const RANGE_SIGMAS: f32 = 12.0;
/// And at least so many DN.
const RANGE_DN: f32 = 6.0;

/// Lines of pixels, each with its value in every frame.
pub(super) struct Grid {
    pub(super) lines: Vec<Line>,
    /// Standard deviation of the noise in DN, of a usual frame.
    pub(super) noise_dn: f32,
    /// Share of the pixels that vary up to the camera's full scale; the checks leave them out.
    pub(super) saturated: f64,
}

/// One line.
pub(super) struct Line {
    frames: usize,
    /// Frames of the first pixel, then of the second and so on.
    values: Vec<f32>,
    /// Pixels that vary in a run.
    pub(super) varies: Vec<bool>,
}

impl Line {
    /// Pixels in the line.
    pub(super) fn len(&self) -> usize {
        self.values.len() / self.frames
    }

    /// A pixel's value in every frame, in DN.
    pub(super) fn pixel(&self, i: usize) -> &[f32] {
        &self.values[i * self.frames..][..self.frames]
    }

    /// The pixels that vary in a run.
    pub(super) fn varying(&self) -> impl Iterator<Item = &[f32]> {
        let indices = (0..self.len()).filter(|i| self.varies[*i]);
        indices.map(|i| self.pixel(i))
    }
}

impl Grid {
    /// Lines along `axis` through frames of one size and format.
    pub(super) fn new(frames: &[Image], axis: Axis) -> Self {
        let (width, height) = frames.first().map_or((0, 0), |f| (f.width(), f.height()));
        let (len, across) = match axis {
            Axis::X => (width, height),
            Axis::Y => (height, width),
        };
        let count = LINES.min(across);
        let mut lines: Vec<Line> = (0..count)
            .map(|n| {
                let at = (2 * n + 1) * across / (2 * count);
                let mut values = Vec::with_capacity(len * frames.len());
                for i in 0..len {
                    let index = match axis {
                        Axis::X => at * width + i,
                        Axis::Y => i * width + at,
                    };
                    values.extend(frames.iter().map(|frame| value(frame, index)));
                }
                Line {
                    frames: frames.len(),
                    values,
                    varies: Vec::new(),
                }
            })
            .collect();
        let noise_dn = noise(&lines, frames.len());
        let least = least_range(noise_dn);
        let full = full_scale(lines.iter().flat_map(|line| line.values.iter().copied()));
        let (mut saturated, mut all) = (0usize, 0usize);
        for line in &mut lines {
            let ranges = (0..line.len()).map(|i| range(line.pixel(i)));
            let wide: Vec<(bool, bool)> = ranges
                .map(|(low, high)| (high - low > least, high >= full))
                .collect();
            saturated += wide.iter().filter(|(wide, full)| *wide && *full).count();
            all += wide.len();
            line.varies = runs(wide.iter().map(|(wide, full)| *wide && !full).collect());
        }
        Self {
            lines,
            noise_dn,
            saturated: saturated as f64 / all.max(1) as f64,
        }
    }

    /// Pixels that vary in runs, from everywhere and no more than so many.
    pub(super) fn sample(&self, most: usize) -> Vec<&[f32]> {
        let varying: Vec<&[f32]> = self.lines.iter().flat_map(Line::varying).collect();
        spread(&varying, most)
    }

    /// Whether a pixel varies, in a run or alone.
    pub(super) fn varies(&self, pixel: &[f32]) -> bool {
        let (low, high) = range(pixel);
        high - low > least_range(self.noise_dn)
    }

    /// Share of the pixels that are at the camera's full scale in some frame, whether they vary or not.
    pub(super) fn at_full_scale(&self) -> f64 {
        let values = self.lines.iter().flat_map(|line| &line.values);
        let full = full_scale(values.copied());
        let pixels = self
            .lines
            .iter()
            .flat_map(|line| (0..line.len()).map(|i| line.pixel(i)));
        share(pixels.map(|pixel| range(pixel).1 >= full))
    }

    /// Share of the pixels that vary in runs.
    pub(super) fn varying(&self) -> f64 {
        share(self.lines.iter().flat_map(|line| &line.varies).copied())
    }
}

/// No more than so many of a list, from everywhere. Equal strides through lines of equal length would
/// meet the same place of each, which may be an edge of the patterns: so one is taken from each
/// stretch, by the golden ratio.
pub(super) fn spread<T: Copy>(list: &[T], most: usize) -> Vec<T> {
    let stride = list.len().div_ceil(most).max(1);
    let within = |(k, stretch): (usize, &[T])| {
        let part = (k as u64 * 0x9E37_79B9) & 0xFFFF_FFFF;
        let place = (part * stretch.len() as u64) >> 32;
        stretch[place as usize]
    };
    list.chunks(stride).enumerate().map(within).collect()
}

fn least_range(noise_dn: f32) -> f32 {
    (RANGE_SIGMAS * noise_dn).max(RANGE_DN)
}

/// The greatest value, where it is the full scale of 8 to 16 bits, at either end of a word; else
/// infinity.
pub(super) fn full_scale(values: impl Iterator<Item = f32>) -> f32 {
    let top = values.fold(0f32, f32::max);
    let word = top as u16;
    let ones = word.count_ones();
    let low = word.trailing_ones() == ones;
    let high = word.leading_ones() == ones;
    match ones >= 8 && (low || high) {
        true => top,
        false => f32::INFINITY,
    }
}

/// Share of what is true.
pub(super) fn share(which: impl Iterator<Item = bool>) -> f64 {
    let (mut yes, mut all) = (0usize, 0usize);
    for one in which {
        yes += usize::from(one);
        all += 1;
    }
    yes as f64 / all.max(1) as f64
}

/// Least and greatest value.
pub(super) fn range(values: &[f32]) -> (f32, f32) {
    let start = (f32::INFINITY, f32::NEG_INFINITY);
    values
        .iter()
        .fold(start, |(low, high), v| (low.min(*v), high.max(*v)))
}

/// Clears what is true in runs shorter than [`RUN`].
pub(super) fn runs(mut which: Vec<bool>) -> Vec<bool> {
    let mut start = 0;
    while start < which.len() {
        let run = which[start..].iter().take_while(|one| **one).count();
        if run < RUN {
            which[start..start + run].fill(false);
        }
        start += run + 1;
    }
    which
}

/// A frame's pixel in DN.
pub(super) fn value(frame: &Image, index: usize) -> f32 {
    f32::from(frame.value(index))
}

/// Every so manyth pixel of a frame's row in DN, into a buffer that is used again.
pub(super) fn read_row(frame: &Image, row: usize, every: usize, into: &mut Vec<f32>) {
    fn of<T: Copy + Into<f32>>(pixels: &[T], every: usize, into: &mut Vec<f32>) {
        match every {
            1 => into.extend(pixels.iter().map(|pixel| (*pixel).into())),
            _ => into.extend(pixels.chunks(every).map(|pixels| pixels[0].into())),
        }
    }
    into.clear();
    let row = row * frame.width()..(row + 1) * frame.width();
    match frame.samples() {
        Samples::U8(samples) => of(&samples[row], every, into),
        Samples::U16(samples) => of(&samples[row], every, into),
    }
}

/// The noise of a usual frame from second differences along the lines, which patterns of many pixels
/// hardly touch: in the lower quartile of the frames are the uniform ones and the coarse codes.
fn noise(lines: &[Line], frames: usize) -> f32 {
    let mut sizes: Vec<f32> = (0..frames)
        .map(|frame| {
            let mut steps: Vec<f32> = Vec::new();
            for line in lines.iter().step_by(NOISE_EVERY) {
                let at = |i: usize| line.values[i * line.frames + frame];
                let middles = 1..line.len().saturating_sub(1);
                steps.extend(middles.map(|i| (at(i - 1) - 2.0 * at(i) + at(i + 1)).abs()));
            }
            let middle = steps.len() / 2;
            match steps.is_empty() {
                true => 0.0,
                false => *steps.select_nth_unstable_by(middle, f32::total_cmp).1,
            }
        })
        .collect();
    sizes.sort_by(f32::total_cmp);
    // A difference 1, -2, 1 has 6 times the variance; 0.6745 of a deviation is the median.
    let median = sizes.get(sizes.len() / 4).copied().unwrap_or(0.0);
    (median / (0.6745 * 6f32.sqrt())).max(0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_spread_is_of_everywhere() {
        let columns: Vec<usize> = (0..64 * 80).map(|i| i % 80).collect();
        let mut found = spread(&columns, 64);
        assert_eq!(found.len(), 64);
        found.sort_unstable();
        let gap = found.windows(2).map(|w| w[1] - w[0]).max();
        assert!(gap <= Some(3), "{found:?}");
        assert_eq!(spread(&[1, 2, 3], 64), [1, 2, 3]);
        assert!(spread::<usize>(&[], 64).is_empty());
    }

    #[test]
    fn short_runs_are_none() {
        let mut which = vec![true; 7];
        which.push(false);
        which.extend(vec![true; 8]);
        let mut want = vec![false; 8];
        want.extend(vec![true; 8]);
        assert_eq!(runs(which), want);
    }
}
