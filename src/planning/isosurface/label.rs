//! Connected components of face-adjacent voxels by run-length labelling: keeps the largest and
//! fills its cavities.

use super::bits::{Bits, ragged};
use phasmid_core::error::Result;
use std::ops::Range;

const MOST_RUNS: usize = 1 << 26;

/// Clears all bits outside the largest component (the component with the largest number of voxels; of
/// equally large components, the first).
pub(super) fn keep_largest(bits: &mut Bits, place: &str) -> Result<()> {
    let mut runs = Runs::of(bits, true, place)?;
    let mut voxels = vec![0_u64; runs.spans.len()];
    for run in 0..runs.spans.len() {
        let span = runs.spans[run];
        voxels[runs.root(run as u32) as usize] += u64::from(span[1] - span[0]);
    }
    let largest = (0..voxels.len()).fold(0, |a, b| if voxels[b] > voxels[a] { b } else { a });
    runs.each_not_of(largest as u32, |j, k, span| {
        write(bits.row_mut(j, k), span, false);
    });
    Ok(())
}

/// Fills cavities: sets all cleared bits of the volume's slices that are not connected to the border
/// around the slices.
pub(super) fn fill(bits: &mut Bits, place: &str) -> Result<()> {
    let mut runs = Runs::of(bits, false, place)?;
    // The first row is all border, and the border of all slices is connected.
    let outside = runs.root(0);
    runs.each_not_of(outside, |j, k, span| {
        write(bits.row_mut(j, k), span, true);
    });
    Ok(())
}

/// Runs of equal bits in the rows of the volume's slices, merged where they touch.
struct Runs {
    /// Range of bits: index of the first bit, and one past the index of the last bit.
    spans: Vec<[u32; 2]>,
    /// An earlier run of the same component, or the run itself.
    parents: Vec<u32>,
    /// First run of each row, and the end of the last row.
    rows: Vec<usize>,
    size: [usize; 3],
}

impl Runs {
    fn of(bits: &Bits, value: bool, place: &str) -> Result<Self> {
        let [ni, nj, nk] = bits.size;
        let mut runs = Self {
            spans: Vec::new(),
            parents: Vec::new(),
            rows: vec![0],
            size: bits.size,
        };
        for k in 1..nk - 1 {
            for j in 0..nj {
                spans(bits.row(j, k), ni, value, &mut runs.spans);
                if runs.spans.len() > MOST_RUNS {
                    let found = format!("more than {MOST_RUNS} runs of voxels");
                    return Err(ragged(found, place));
                }
                runs.parents
                    .extend(runs.parents.len() as u32..runs.spans.len() as u32);
                runs.rows.push(runs.spans.len());
                let row = runs.rows.len() - 2;
                if j > 0 {
                    runs.join(row - 1, row);
                }
                if k > 1 {
                    runs.join(row - nj, row);
                }
            }
        }
        Ok(runs)
    }

    fn row(&self, row: usize) -> Range<usize> {
        self.rows[row]..self.rows[row + 1]
    }

    /// Merges adjacent runs of two rows.
    fn join(&mut self, before: usize, row: usize) {
        let (mut a, mut b) = (self.row(before), self.row(row));
        while !a.is_empty() && !b.is_empty() {
            let (s, t) = (self.spans[a.start], self.spans[b.start]);
            if s[0] < t[1] && t[0] < s[1] {
                let (p, q) = (self.root(a.start as u32), self.root(b.start as u32));
                let (first, other) = (p.min(q), p.max(q));
                self.parents[other as usize] = first;
            }
            if s[1] < t[1] {
                a.start += 1;
            } else {
                b.start += 1;
            }
        }
    }

    /// Returns the first run of a run's component.
    fn root(&mut self, mut run: u32) -> u32 {
        while self.parents[run as usize] != run {
            // Path halving, to speed up later look-ups.
            let over = self.parents[self.parents[run as usize] as usize];
            self.parents[run as usize] = over;
            run = over;
        }
        run
    }

    /// Calls `act` for every run that is not part of a component, with its row.
    fn each_not_of(&mut self, body: u32, mut act: impl FnMut(usize, usize, [u32; 2])) {
        for row in 0..self.rows.len() - 1 {
            for run in self.row(row) {
                if self.root(run as u32) != body {
                    let (j, k) = (row % self.size[1], row / self.size[1] + 1);
                    act(j, k, self.spans[run]);
                }
            }
        }
    }
}

/// Appends the runs of a value in a row of `count` bits.
fn spans(row: &[u64], count: usize, value: bool, to: &mut Vec<[u32; 2]>) {
    let flip = if value { 0 } else { u64::MAX };
    let mut at = 0;
    while let Some(begin) = next_one(row, flip, at, count) {
        let end = next_one(row, !flip, begin, count).unwrap_or(count);
        to.push([begin as u32, end as u32]);
        at = end;
    }
}

/// Returns the first set bit of the row xor `flip` at or after `from`.
fn next_one(row: &[u64], flip: u64, from: usize, count: usize) -> Option<usize> {
    let mut at = from;
    while at < count {
        let rest = (row[at / 64] ^ flip) >> (at % 64);
        if rest != 0 {
            let found = at + rest.trailing_zeros() as usize;
            return (found < count).then_some(found);
        }
        at = (at / 64 + 1) * 64;
    }
    None
}

/// Sets or clears the bits of a run.
fn write(row: &mut [u64], [begin, end]: [u32; 2], value: bool) {
    for (word, bits) in row.iter_mut().enumerate() {
        let first = 64 * word as u32;
        let (from, to) = (begin.max(first), end.min(first + 64));
        if from < to {
            let mask = u64::MAX >> (64 - (to - from)) << (from - first);
            *bits = if value { *bits | mask } else { *bits & !mask };
        }
    }
}
