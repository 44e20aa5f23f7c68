//! Decodes one row of pixels (pass 1).
//!
//! `dispatch` chooses the instruction set, `axis` decodes one axis of a row, `bits` its Gray code;
//! `kernel` holds the constants of an axis.

mod axis;
mod bits;
mod dispatch;
mod kernel;
#[cfg(test)]
mod tests;

pub(super) use dispatch::{apply_flags, decode_row, judge_borders, judge_row, triangulate_row};
pub(super) use kernel::AxisKernel;

use super::edges;
use super::gray::GrayRow;
use super::maps::Verdict;
use super::phase::{RowNoise, SetRow};
use super::robust_scale::RobustScale;
use super::sample::Sample;
use axis::axis_row;

/// Data shared by all rows of a decoding.
pub(super) struct Job<'a, T> {
    pub(super) frames: &'a [&'a [T]],
    pub(super) kernels: &'a [AxisKernel],
    /// Typical residuals of each kernel's sets in this capture.
    pub(super) robust_scale: &'a [Vec<RobustScale>],
    pub(super) references: Option<(usize, usize)>,
    /// Number of each axis' finest Gray bits that are not used.
    pub(super) unused_bits: [usize; 2],
    pub(super) noise: RowNoise,
    pub(super) saturation: f32,
    /// Range from black level to saturation, in DN.
    pub(super) range: f32,
    pub(super) min_modulation: f32,
    /// Minimum modulation as a fraction of half of white minus black.
    pub(super) min_contrast: f32,
    pub(super) max_phase_sigma: f32,
    pub(super) width: usize,
}

/// Buffers of a worker thread, each one row long.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    sets: Vec<SetRow>,
    gray: GrayRow,
    top: Vec<f32>,
    /// Sum of the sets' means.
    sum: Vec<f32>,
    /// Mean of white and black.
    middle: Vec<f32>,
    /// Half of white minus black; without these frames the modulation.
    half: Vec<f32>,
    /// Standard deviation of a sample at the pixel's mean.
    sigma: Vec<f32>,
    variance: Vec<f32>,
    ok: Vec<bool>,
    candidate: (Vec<f32>, Vec<f32>),
}

/// A row of an axis' maps.
pub(super) struct AxisOut<'a> {
    pub(super) coordinate: &'a mut [f32],
    pub(super) sigma: &'a mut [f32],
    pub(super) verdict: &'a mut [Verdict],
}
fn clear(buffer: &mut Vec<f32>, n: usize) {
    buffer.clear();
    buffer.resize(n, 0.0);
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
/// The outputs in the order of the kernels.
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
