//! Checks the bits of a Gray code by the edges between its cells.
//!
//! Along a surface the code counts up or down by one or stays. Where exactly one bit changes between
//! neighbouring pixels, the two pixels should lie in adjacent cells. If two bits are exchanged, or one
//! frame shows another pattern, the cells are far apart. At depth steps several bits change at once;
//! such changes are not evaluated.

use super::pixels::{Line, Pixels};
use super::sample::Sample;
use crate::plan::{AxisPlan, Plan};
use phasmid_pattern::gray_decode;
use rayon::prelude::*;

/// Number of rows and of columns that are examined.
const LINES: usize = 32;
/// Minimum contrast of a clear bit, relative to the full contrast.
const CLEAR: f32 = 0.25;
/// Minimum full contrast of a pixel, in standard deviations of the noise.
const CONTRAST: f64 = 14.0;
/// Maximum distance in pixels between two compared pixels; the pixels in between lie on an edge and have
/// an unclear bit.
const APART: usize = 4;
/// Minimum number of edges of a bit that are needed to judge the bit.
const FEWEST: usize = 12;

/// Whether an axis has a bit with more edges between distant cells than between adjacent cells.
pub(super) fn has_jumps(sample: &Sample, axis: &AxisPlan) -> bool {
    let Some(code) = &axis.gray else {
        return false;
    };
    let least = (CONTRAST * sample.usual_noise_dn()) as f32;
    let map = sample.decoded.axis(axis.axis);
    let unused = map.map_or(0, |map| map.unused_bits);
    let none = || Changes {
        of_bits: vec![[0; 2]; code.bits.len()],
        of_words: [0; 2],
    };
    let count = |words: &[Option<u64>], line: &Line| {
        let mut found = none();
        let mut before: Option<(usize, u64)> = None;
        for (i, pixel) in line.pixels().enumerate() {
            let Some(now) = words[pixel] else {
                continue;
            };
            if let Some((_, then)) = before.filter(|(place, _)| i - place <= APART) {
                found.add(then, now);
            }
            before = Some((i, now));
        }
        found
    };
    let ways = [(&sample.rows, true), (&sample.columns, false)].into_par_iter();
    let of_ways = ways.map(|(pixels, along_rows)| {
        let words = words(&sample.plan, axis, unused, pixels, least);
        let lines = pixels.lines(along_rows, LINES);
        let of_lines = lines.iter().map(|line| count(&words, line));
        of_lines.fold(none(), Changes::and)
    });
    let Changes { of_bits, of_words } = of_ways.reduce(none, Changes::and);
    let told = |[near, far]: &[usize; 2]| near + far >= FEWEST && far > near;
    // A code without fringes may be finer than the camera resolves: changes of several bits then
    // predominate.
    let resolved = !axis.sets.is_empty() || of_words[0] > of_words[1];
    resolved && of_bits.iter().any(told)
}

/// Number of changes of the code between neighbouring pixels.
struct Changes {
    /// Changes of each bit alone: [between adjacent cells, between distant cells].
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

/// Returns each pixel's code word without the `unused` finest bits; `None` unless all bits are clear
/// and the contrast is at least `least`, in DN.
fn words(
    plan: &Plan,
    axis: &AxisPlan,
    unused: usize,
    pixels: &Pixels,
    least: f32,
) -> Vec<Option<u64>> {
    // White and black give the mean and half of the contrast; if they are missing, the fringes do.
    let light = match (plan.references(), axis.sets.first()) {
        (Some((white, black)), _) => {
            let [white, black] = [white, black].map(|frame| pixels.frame(frame));
            let middle = zipped(white, black, |white, black| 0.5 * (white + black));
            let half = zipped(white, black, |white, black| 0.5 * (white - black));
            Some((middle, half, pixels.saturated_in(plan.white)))
        }
        (None, Some(set)) => pixels.fringes(set).map(|fringes| {
            let half = zipped(&fringes.cos, &fringes.sin, |c, s| (c * c + s * s).sqrt());
            let saturated = pixels.saturated_in(set.frames.iter().copied());
            (fringes.mean.clone(), half, saturated)
        }),
        (None, None) => None,
    };
    let bits = || {
        axis.gray
            .iter()
            .flat_map(|code| code.bits.iter().skip(unused))
    };
    // If every bit has a complement, the code can be read even where white is saturated.
    let complements = bits().all(|bit| bit.plain.is_some() && bit.inverse.is_some());
    let mut words = vec![0u64; pixels.len()];
    let mut clear: Vec<bool> = match &light {
        Some((_, half, saturated)) => {
            let lit = half.iter().zip(saturated);
            lit.map(|(half, saturated)| 2.0 * half >= least && (complements || !saturated))
                .collect()
        }
        None => vec![true; pixels.len()],
    };
    for (place, bit) in bits().enumerate() {
        let [plain, inverse] = [bit.plain, bit.inverse].map(|k| k.map(|k| pixels.frame(k)));
        let contrast = match (plain, inverse, &light) {
            (Some(plain), Some(inverse), _) => zipped(plain, inverse, |p, i| 0.5 * (p - i)),
            (Some(plain), None, Some((middle, ..))) => zipped(plain, middle, |p, m| p - m),
            (None, Some(inverse), Some((middle, ..))) => zipped(inverse, middle, |i, m| m - i),
            _ => return vec![None; pixels.len()],
        };
        match &light {
            Some((_, half, _)) => {
                for (clear, (contrast, half)) in clear.iter_mut().zip(contrast.iter().zip(half)) {
                    *clear &= contrast.abs() >= CLEAR * half;
                }
            }
            None => {
                for (clear, contrast) in clear.iter_mut().zip(&contrast) {
                    *clear &= 2.0 * contrast.abs() >= least;
                }
            }
        }
        for (word, contrast) in words.iter_mut().zip(&contrast) {
            *word |= u64::from(*contrast > 0.0) << place;
        }
    }
    let words = words.into_iter().zip(clear);
    words.map(|(word, clear)| clear.then_some(word)).collect()
}

fn zipped(a: &[f32], b: &[f32], of: impl Fn(f32, f32) -> f32) -> Vec<f32> {
    a.iter().zip(b).map(|(a, b)| of(*a, *b)).collect()
}
