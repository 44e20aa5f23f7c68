//! Inside/outside bitmap of a volume, with a border of outside voxels.

use crate::volume::{Volume, Voxels};
use phasmid_core::error::Error;
use rayon::prelude::*;

/// One bit per voxel, in rows along i, with a border of outside voxels. Voxel (i, j, k) of the
/// volume is bit i + 1 of row (j + 1, k + 1).
pub(super) struct Bits {
    /// Number of voxels including the border.
    pub(super) size: [usize; 3],
    /// 64-bit words per row.
    pub(super) words: usize,
    bits: Vec<u64>,
}

impl Bits {
    /// Marks the voxels of `level` or more.
    pub(super) fn of(volume: &Volume, level: f64) -> Self {
        let size = volume.grid().size.map(|n| n + 2);
        let words = size[0].div_ceil(64);
        let mut bits = vec![0; words * size[1] * size[2]];
        let [ni, nj, _] = volume.grid().size;
        bits.par_chunks_mut(words * size[1])
            .skip(1)
            .take(size[2] - 2)
            .enumerate()
            .for_each(|(k, slice)| {
                for j in 0..nj {
                    let row = &mut slice[words * (j + 1)..words * (j + 2)];
                    let from = ni * (j + nj * k);
                    // One loop per value type, so that each compiles to compares and shifts.
                    match volume.voxels() {
                        Voxels::I16(v) => set(row, &v[from..from + ni], |x| f64::from(x) >= level),
                        Voxels::F32(v) => set(row, &v[from..from + ni], |x| f64::from(x) >= level),
                    }
                }
            });
        Self { size, words, bits }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.bits.iter().all(|&word| word == 0)
    }

    /// Returns a row; coordinates include the border.
    pub(super) fn row(&self, j: usize, k: usize) -> &[u64] {
        let from = self.words * (j + self.size[1] * k);
        &self.bits[from..from + self.words]
    }

    pub(super) fn row_mut(&mut self, j: usize, k: usize) -> &mut [u64] {
        let from = self.words * (j + self.size[1] * k);
        &mut self.bits[from..from + self.words]
    }
}

fn set<T: Copy>(row: &mut [u64], numbers: &[T], inside: impl Fn(T) -> bool) {
    // The first bit belongs to the border.
    for (at, &x) in numbers.iter().enumerate() {
        row[(at + 1) / 64] |= u64::from(inside(x)) << ((at + 1) % 64);
    }
}

/// Returns the largest value of a volume.
pub(super) fn highest(volume: &Volume) -> f32 {
    match volume.voxels() {
        Voxels::I16(v) => v.iter().copied().max().map_or(0.0, f32::from),
        Voxels::F32(v) => v.iter().copied().fold(f32::NEG_INFINITY, f32::max),
    }
}

/// Error for a volume with unreasonably many components.
pub(super) fn ragged(found: String, place: &str) -> Error {
    Error::input(
        place,
        found,
        "a surface of solid parts, not noise: smooth the volume, or choose another level",
    )
}
