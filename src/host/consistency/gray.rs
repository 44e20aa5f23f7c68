//! The bits of a Gray code against other orders of them.
//!
//! From pixel to pixel the code counts up or down by one or stays, but for steps in depth. With two
//! bits exchanged it jumps at each of their edges. So of two orders the one that jumps less is the
//! right one, and a step in depth, which is a jump in both, speaks for neither.

use super::grid::{Grid, range};
use phasmid_decode::{AxisPlan, GrayBit, GrayCode};
use phasmid_pattern::gray_decode;

/// Jumps count as so many cells at most.
const FAR: u64 = 4;
/// Edges that have to speak for another order.
const LEAST_EDGES: usize = 24;
/// And so many times as many as speak against it.
const MAJORITY: usize = 4;

/// How the bits of a pixel's code are taken otherwise.
#[derive(Clone, Copy)]
enum Other {
    Exchanged(usize, usize),
    Inverted(usize),
}

impl Other {
    fn apply(self, word: u64) -> u64 {
        match self {
            Self::Exchanged(a, b) => {
                let differ = (word >> a ^ word >> b) & 1;
                word ^ (differ << a | differ << b)
            }
            Self::Inverted(a) => word ^ 1 << a,
        }
    }
}

/// Whether the code jumps distinctly less with two bits exchanged, or one complemented.
pub(super) fn check(axis: &AxisPlan, grid: &Grid) -> Result<(), String> {
    let Some(code) = &axis.gray else {
        return Ok(());
    };
    let words = neighbours(code, grid);
    let jump = |a: u64, b: u64| gray_decode(a).abs_diff(gray_decode(b)).min(FAR);
    let mut worst: Option<(usize, Other)> = None;
    for other in others(code) {
        let (mut speak_for, mut speak_against) = (0, 0);
        for &(a, b) in &words {
            let (asked, tried) = (jump(a, b), jump(other.apply(a), other.apply(b)));
            speak_for += usize::from(tried < asked);
            speak_against += usize::from(tried > asked);
        }
        let distinct = speak_for >= LEAST_EDGES && speak_for > MAJORITY * speak_against;
        if distinct && worst.is_none_or(|(before, _)| speak_for > before) {
            worst = Some((speak_for, other));
        }
    }
    let frame = |bit: usize| {
        let GrayBit { plain, inverse } = code.bits[bit];
        plain.or(inverse).unwrap_or_default()
    };
    match worst {
        None => Ok(()),
        Some((_, Other::Exchanged(a, b))) => {
            let (a, b) = (frame(a), frame(b));
            Err(format!(
                "frames {} and {} look exchanged",
                a.min(b),
                a.max(b)
            ))
        }
        Some((_, Other::Inverted(bit))) => Err(format!(
            "frame {} and its complement look exchanged",
            frame(bit)
        )),
    }
}

fn others(code: &GrayCode) -> Vec<Other> {
    let bits = code.bits.len();
    let pairs = (0..bits).flat_map(|a| (a + 1..bits).map(move |b| Other::Exchanged(a, b)));
    let both = |bit: &usize| code.bits[*bit].plain.is_some() && code.bits[*bit].inverse.is_some();
    pairs
        .chain((0..bits).filter(both).map(Other::Inverted))
        .collect()
}

/// The word that a pixel reads, bit b of it from bit b's frames.
pub(super) fn word(code: &GrayCode, values: &[f32]) -> u64 {
    let (low, high) = range(values);
    let middle = 0.5 * (low + high);
    let bit = |bit: &GrayBit| match (bit.plain, bit.inverse) {
        (Some(plain), Some(inverse)) => values[plain] > values[inverse],
        (Some(plain), None) => values[plain] > middle,
        (None, inverse) => inverse.is_some_and(|inverse| values[inverse] <= middle),
    };
    let bits = code.bits.iter().enumerate();
    bits.fold(0u64, |word, (b, each)| word | u64::from(bit(each)) << b)
}

/// The codes of neighbours along the lines that differ.
fn neighbours(code: &GrayCode, grid: &Grid) -> Vec<(u64, u64)> {
    let mut found = Vec::new();
    for line in &grid.lines {
        let mut before: Option<u64> = None;
        for i in 0..line.len() {
            let now = line.varies[i].then(|| word(code, line.pixel(i)));
            if let (Some(a), Some(b)) = (before, now)
                && a != b
            {
                found.push((a, b));
            }
            before = now;
        }
    }
    found
}
