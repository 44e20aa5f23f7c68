//! The bits of a Gray code, by their edges.
//!
//! Along a surface the code counts up or down by one or stays. Where exactly one bit
//! changes between neighbours, the cells are next to each other; with two bits exchanged, or one frame of
//! another pattern, they are far apart. At steps in depth several bits change at once, and those say
//! nothing.

use super::sample::Sample;
use crate::plan::{AxisPlan, Plan};
use phasmid_pattern::{Image, gray_decode};
use rayon::prelude::*;

/// Lines along the rows and down the columns that are looked at.
const LINES: usize = 32;
/// Part of the contrast that makes a bit clear.
const CLEAR: f64 = 0.25;
/// Contrast in standard deviations of noise, at least.
const CONTRAST: f64 = 14.0;
/// Pixels that may lie between neighbours: those on an edge are not clear.
const APART: usize = 4;

/// Edges of a bit that tell.
const FEWEST: usize = 12;

/// Whether most edges of some bit of an axis lie between cells that are not next to each other.
pub(super) fn has_jumps(sample: &Sample, axis: &AxisPlan, frames: &[Image]) -> bool {
    let (Some(code), Some(first)) = (&axis.gray, frames.first()) else {
        return false;
    };
    let (width, height) = (first.width(), first.height());
    let full = f64::from(sample.full);
    let least = CONTRAST * sample.usual_noise_dn();
    let map = sample.decoded.axis(axis.axis);
    let unused = map.map_or(0, |map| map.unused_bits);
    let word = |pixel: usize| word(&sample.plan, axis, unused, frames, pixel, [least, full]);
    let none = || Changes {
        of_bits: vec![[0; 2]; code.bits.len()],
        of_words: [0; 2],
    };
    let count = |length: usize, start: usize, step: usize| {
        let mut found = none();
        let mut before: Option<(usize, u64)> = None;
        for i in 0..length {
            let Some(now) = word(start + i * step) else {
                continue;
            };
            if let Some((_, then)) = before.filter(|(place, _)| i - place <= APART) {
                found.add(then, now);
            }
            before = Some((i, now));
        }
        found
    };
    let ways = [(width, height, 1, width), (height, width, width, 1)].into_par_iter();
    let of_lines = ways.flat_map(|(length, across, step, stride)| {
        let lines = LINES.min(across);
        let start = move |line| (2 * line + 1) * across / (2 * lines) * stride;
        let lines = (0..lines).into_par_iter();
        lines.map(move |line| count(length, start(line), step))
    });
    let Changes { of_bits, of_words } = of_lines.reduce(none, Changes::and);
    let told = |[near, far]: &[usize; 2]| near + far >= FEWEST && far > near;
    // A code without fringes may be finer than the camera resolves: most changes are then of several bits.
    let resolved = !axis.sets.is_empty() || of_words[0] > of_words[1];
    resolved && of_bits.iter().any(told)
}

/// Number of changes of the code between neighbours.
struct Changes {
    /// Changes of each bit alone: [between cells next to each other, others].
    of_bits: Vec<[usize; 2]>,
    /// Changes of [one bit, several bits].
    of_words: [usize; 2],
}

impl Changes {
    fn add(&mut self, then: u64, now: u64) {
        let changed = now ^ then;
        match changed.count_ones() {
            0 => {}
            1 => {
                let apart = gray_decode(now).abs_diff(gray_decode(then));
                self.of_bits[changed.trailing_zeros() as usize][usize::from(apart > 1)] += 1;
                self.of_words[0] += 1;
            }
            _ => self.of_words[1] += 1,
        }
    }

    fn and(mut self, other: Self) -> Self {
        let sum = |to: &mut [usize; 2], from: [usize; 2]| {
            to[0] += from[0];
            to[1] += from[1];
        };
        let bits = self.of_bits.iter_mut().zip(other.of_bits);
        bits.for_each(|(to, from)| sum(to, from));
        sum(&mut self.of_words, other.of_words);
        self
    }
}

/// The code word of a pixel without its `unused` finest bits, if each bit is clear; contrasts are at least
/// `least` and samples below `full`, in DN.
fn word(
    plan: &Plan,
    axis: &AxisPlan,
    unused: usize,
    frames: &[Image],
    pixel: usize,
    [least, full]: [f64; 2],
) -> Option<u64> {
    let value = |frame: usize| f64::from(frames[frame].value(pixel));
    // White and black, or else the fringes, tell the middle and half of the contrast.
    let light = || match (plan.references(), axis.sets.first()) {
        (Some((white, black)), _) => {
            let (white, black) = (value(white), value(black));
            (white < full).then_some((0.5 * (white + black), 0.5 * (white - black)))
        }
        (None, Some(set)) => {
            let samples: Vec<f64> = set.frames.iter().map(|k| value(*k)).collect();
            let [mean, c, s] = set.solve(&samples);
            samples
                .iter()
                .all(|v| *v < full)
                .then(|| (mean, c.hypot(s)))
        }
        (None, None) => None,
    };
    let light = light();
    let mut word = 0;
    let bits = axis.gray.iter().flat_map(|code| &code.bits).skip(unused);
    for (place, bit) in bits.enumerate() {
        let (contrast, half) = match (bit.plain, bit.inverse, light) {
            (Some(plain), Some(inverse), _) => {
                let [plain, inverse] = [plain, inverse].map(value);
                let half = light.map_or(0.5 * (plain - inverse).abs(), |(_, half)| half);
                (0.5 * (plain - inverse), half)
            }
            (Some(plain), None, Some((middle, half))) => (value(plain) - middle, half),
            (None, Some(inverse), Some((middle, half))) => (middle - value(inverse), half),
            _ => return None,
        };
        if 2.0 * half < least || contrast.abs() < CLEAR * half {
            return None;
        }
        word |= u64::from(contrast > 0.0) << place;
    }
    Some(word)
}
