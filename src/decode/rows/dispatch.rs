//! Chooses the instruction set for all row kernels.
//!
//! The kernels are written once, so that they vectorise; on x86-64 with AVX2 a version compiled for
//! it runs. Neither version fuses multiplication and addition, so both give identical bits.

use super::{AxisOut, Job, Scratch, apply_body, decode_body};
use crate::borders::{self, Near};
use crate::edges::{self, Around};
use crate::sample::Sample;
use crate::triangulate::{CoordinateRow, Triangulator};
use phasmid_core::simd::widest;

widest! {
    /// Pass 1 of row `v`.
    pub(crate) fn decode_row<T: Sample>(
        job: &Job<'_, T>,
        v: usize,
        scratch: &mut Scratch,
        outs: [Option<AxisOut<'_>>; 2],
        modulation: &mut [f32],
        intensity: &mut [f32],
    ) => decode_body
}

widest! {
    /// Pass 2 of a row: see [`edges::judge_row`].
    pub(crate) fn judge_row(
        around: &Around<'_>, period: f32, flags: &mut [u8],
    ) => edges::judge_row
}

widest! {
    /// Pass 2 of a row, once the first flags are applied: see [`borders::judge_row`].
    pub(crate) fn judge_borders(
        near: &Near<'_>, period: f32, flags: &mut [u8],
    ) => borders::judge_row
}

widest! {
    /// The second half of pass 2: removes a row's flagged pixels from a map.
    pub(crate) fn apply_flags(out: AxisOut<'_>, flags: &[u8]) => apply_body
}

widest! {
    /// Pass 3 of row `v`: see [`Triangulator::row`].
    pub(crate) fn triangulate_row(
        triangulator: &Triangulator,
        v: usize,
        x: Option<CoordinateRow<'_>>,
        y: Option<CoordinateRow<'_>>,
        depth: &mut [f32],
        sigma: &mut [f32],
    ) => Triangulator::row
}
