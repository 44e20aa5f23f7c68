//! Decodes one row of pixels (pass 1), and chooses the instruction set for all row kernels.
//!
//! The kernels are written once in a form that vectorises, and compiled twice: on x86-64 with AVX2, the
//! AVX2 version runs. Neither version fuses multiplication and addition, so both give identical bits.
//!
//! `axis` decodes one axis of a row, `fringes` its fringe sets and `bits` its Gray code; `job` holds
//! their data.

mod axis;
mod bits;
mod fringes;
mod job;
#[cfg(test)]
mod tests;

pub(super) use job::{AxisKernel, AxisOut, BAND, Job, Scratch};

use super::borders::{self, Near};
use super::edges::{self, Around};
use super::maps::Verdict;
use super::sample::Sample;
use super::triangulate::{CoordinateRow, Triangulator};
use axis::axis_row;
use job::clear;
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

#[inline(always)]
fn decode_body<T: Sample>(
    job: &Job<'_, T>,
    v: usize,
    scratch: &mut Scratch,
    outs: [Option<AxisOut<'_>>; 2],
    modulation: &mut [f32],
    intensity: &mut [f32],
) {
    let n = job.width;
    let row = |frame: usize| &job.frames[frame][v * n..(v + 1) * n];
    clear(&mut scratch.middle, n);
    clear(&mut scratch.half, n);
    if let Some((white, black)) = job.references {
        let (white, black) = (row(white), row(black));
        let (middle, half) = (&mut scratch.middle[..n], &mut scratch.half[..n]);
        for i in 0..n {
            let (w, b) = (white[i].dn(), black[i].dn());
            middle[i] = 0.5 * (w + b);
            half[i] = 0.5 * (w - b);
        }
    }
    let mut first = true;
    let axes = job.kernels.iter().zip(job.robust_scale);
    for ((kernel, robust_scale), out) in axes.zip(matched(job.kernels, outs)) {
        axis_row(job, kernel, robust_scale, &row, scratch, out);
        if first {
            first = false;
            match scratch.sets.first() {
                Some(set) if !kernel.sets.is_empty() => modulation.copy_from_slice(&set.modulation),
                _ => modulation.copy_from_slice(&scratch.half),
            }
            let scale = 1.0 / job.range;
            let brightness = if job.references.is_some() {
                &scratch.half[..n]
            } else {
                &modulation[..n]
            };
            for i in 0..n {
                intensity[i] = (2.0 * brightness[i] * scale).clamp(0.0, 1.0);
            }
        }
    }
}

#[inline(always)]
fn apply_body(out: AxisOut<'_>, flags: &[u8]) {
    let n = flags.len();
    let (x, sigma) = (&mut out.coordinate[..n], &mut out.sigma[..n]);
    let verdict = &mut out.verdict[..n];
    for i in 0..n {
        let reason = match flags[i] {
            edges::MIXED => Verdict::Mixed,
            edges::FINE => Verdict::Uncertain,
            _ => Verdict::Stray,
        };
        let goes = (flags[i] != edges::KEEP) & (verdict[i] as u8 == Verdict::Valid as u8);
        verdict[i] = if goes { reason } else { verdict[i] };
        x[i] = if goes { f32::NAN } else { x[i] };
        sigma[i] = if goes { f32::NAN } else { sigma[i] };
    }
}

/// Pairs each kernel with its output.
fn matched<'a, 'b>(
    kernels: &'b [AxisKernel],
    mut outs: [Option<AxisOut<'a>>; 2],
) -> impl Iterator<Item = AxisOut<'a>> + use<'a, 'b> {
    kernels.iter().map(move |k| {
        outs[k.axis as usize]
            .take()
            .expect("a map for each axis of the plan")
    })
}
