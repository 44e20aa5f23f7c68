//! The bits of a Gray code, by their edges.
//!
//! Along a surface the code counts up or down by one or stays. Where exactly one bit
//! changes between neighbours, the cells are next to each other; with two bits exchanged, or one frame of
//! another pattern, they are far apart. At steps in depth several bits change at once, and those say
//! nothing.

use super::sample::{Sample, full_scale};
use crate::plan::{AxisPlan, Plan};
use phasmid_pattern::{Image, gray_decode};

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
    // Edges of each bit: between neighbouring cells, and others.
    let mut edges = vec![[0usize; 2]; code.bits.len()];
    // Changes of one bit and of several. A code without fringes may be finer than the camera resolves: most
    // changes are then of several.
    let mut changes = [0usize; 2];
    let (width, height) = (first.width(), first.height());
    let full = f64::from(full_scale(frames));
    let least = CONTRAST * sample.usual_noise_dn();
    let map = sample.decoded.axis(axis.axis);
    let unused = map.map_or(0, |map| map.unused_bits);
    let word = |pixel: usize| word(&sample.plan, axis, unused, frames, pixel, [least, full]);
    for (length, across, step, stride) in [(width, height, 1, width), (height, width, width, 1)] {
        let lines = LINES.min(across);
        for line in 0..lines {
            let start = (2 * line + 1) * across / (2 * lines) * stride;
            let mut before: Option<(usize, u64)> = None;
            for i in 0..length {
                let Some(now) = word(start + i * step) else {
                    continue;
                };
                let near = before.filter(|(place, then)| i - place <= APART && *then != now);
                if let Some((_, then)) = near {
                    let changed = now ^ then;
                    changes[usize::from(changed.count_ones() > 1)] += 1;
                    if changed.count_ones() == 1 {
                        let apart = gray_decode(now).abs_diff(gray_decode(then));
                        edges[changed.trailing_zeros() as usize][usize::from(apart > 1)] += 1;
                    }
                }
                before = Some((i, now));
            }
        }
    }
    let told = |[near, far]: &[usize; 2]| near + far >= FEWEST && far > near;
    let resolved = !axis.sets.is_empty() || changes[0] > changes[1];
    resolved && edges.iter().any(told)
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
