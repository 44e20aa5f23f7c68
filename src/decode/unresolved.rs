//! Gray bits that the camera does not resolve.
//!
//! Blur reduces the contrast of the finest stripes first. A pixel with two bits of low contrast is
//! rejected, because it may see two places at once ([`super::order`]), so a code finer than the camera
//! resolves loses most pixels. If many pixels of a capture are lost, the contrast of the bits decides
//! whether this is the reason. If so, the finest bits are left out, which merges their cells. They stay
//! out if this recovers most of the lost pixels.

use super::gray::{GrayBit, Threshold};
use super::maps::{AxisMap, Verdict};
use super::order::{SURE, TWO_PLACES};
use super::rows::{AxisKernel, Job};
use super::sample::Sample;
use phasmid_core::statistics::finite_median;
use phasmid_pattern::Axis;

/// Fraction of uncertain pixels, among uncertain and valid ones, above which the bits are examined.
const LOSS: f64 = 0.05;
/// Maximum fraction of the lost pixels that may stay lost when the bits are left out; if more stay lost,
/// the bits are used.
const LEFT: f64 = 0.5;
/// Approximate number of pixels sampled.
const PIXELS: usize = 60_000;
/// Side of the parts of the image whose contrast is determined separately, in pixels: blur varies
/// with depth.
const PART: usize = 64;
/// Minimum number of pixels for the contrast of a part.
const FEWEST: usize = 20;
/// Fraction of the image's parts in which a bit may be unresolved and is still used.
const FEW: f64 = 0.1;

/// Finest bits of a Gray code that are left out.
pub(super) struct UnresolvedBits {
    pub(super) axis: Axis,
    /// Number of pixels with uncertain order while the bits are used.
    lost: usize,
    /// Number of bits that are left out.
    pub(super) count: usize,
    /// Typical contrast of the finest bit as a fraction of the full contrast.
    contrast: f32,
    /// Width of the remaining cells in projector pixels.
    cell: f32,
}

impl UnresolvedBits {
    /// Returns whether the bits are the reason for most of the losses, given the map decoded without
    /// these bits.
    pub(super) fn explain(&self, without: &AxisMap) -> bool {
        without.count(Verdict::Uncertain) as f64 <= LEFT * self.lost as f64
    }

    pub(super) fn note(&self) -> String {
        let bits = match self.count {
            1 => "the finest Gray bit is not resolved and is".to_owned(),
            n => format!("the {n} finest Gray bits are not resolved and are"),
        };
        format!(
            "axis {}: {bits} left out (contrast of the finest {:.0} %); the cells are {} px wide",
            self.axis,
            100.0 * self.contrast,
            (self.cell * 100.0).round() / 100.0
        )
    }
}

/// Returns the finest bits of an axis' Gray code to leave out, if they cause the loss of many pixels.
pub(super) fn unresolved_bits<T: Sample>(
    job: &Job<'_, T>,
    kernel: &AxisKernel,
    map: &AxisMap,
) -> Option<UnresolvedBits> {
    let join = kernel.join?;
    let [lost, valid] = [Verdict::Uncertain, Verdict::Valid].map(|v| map.count(v));
    if lost as f64 <= LOSS * (lost + valid) as f64 {
        return None;
    }
    // Cells wider than the fringes' repeat determine no order, and one bit must remain.
    let is_enough = |bits: &usize| join.without(*bits).cell <= join.repeat * (1.0 + 1e-6);
    let most = (1..kernel.bits.len()).take_while(is_enough).count();
    let contrasts: Vec<_> = (0..most)
        .map(|bit| Contrast::of(job, kernel, bit))
        .take_while(|contrast| contrast.unresolved > FEW)
        .collect();
    Some(UnresolvedBits {
        axis: kernel.axis,
        lost,
        count: contrasts.len(),
        contrast: contrasts.first()?.median,
        cell: join.without(contrasts.len()).cell,
    })
}

/// Contrast of a bit, as a fraction of the full contrast.
struct Contrast {
    /// Median over the image's parts.
    median: f32,
    /// Fraction of the parts in which more than half of the pixels have too little contrast.
    unresolved: f64,
}

impl Contrast {
    fn of<T: Sample>(job: &Job<'_, T>, kernel: &AxisKernel, bit: usize) -> Self {
        let frames = &kernel.bits[bit].0;
        let frame = frames.plain.or(frames.inverse);
        let height = frame.map_or(0, |frame| job.frames[frame].len()) / job.width;
        let columns = job.width.div_ceil(PART);
        let mut parts = vec![Vec::new(); columns * height.div_ceil(PART)];
        let pixels = job.width * height;
        // Odd, so that the samples do not all fall on the same stripes; small enough for each part.
        let stride = (pixels / PIXELS).min(PART * PART / (8 * FEWEST)) | 1;
        for i in (0..pixels).step_by(stride) {
            let [v, u] = [i / job.width, i % job.width].map(|at| at / PART);
            parts[v * columns + u].extend(contrast(job, kernel, bit, i));
        }
        let medians: Vec<f32> = parts
            .into_iter()
            .filter(|part| part.len() >= FEWEST)
            .filter_map(finite_median)
            .collect();
        let unresolved = medians.iter().filter(|c| **c < TWO_PLACES).count();
        Self {
            unresolved: unresolved as f64 / medians.len().max(1) as f64,
            median: finite_median(medians).unwrap_or(f32::NAN),
        }
    }
}

/// The contrast of a bit at a pixel that is lit well above the noise.
fn contrast<T: Sample>(job: &Job<'_, T>, kernel: &AxisKernel, bit: usize, i: usize) -> Option<f32> {
    let sample = |frame: usize| job.frames[frame][i].dn();
    let fringes = kernel.sets.first().map(|set| {
        let [mean, c, s, _] = set.solve(sample);
        (mean, c.hypot(s))
    });
    let references = job.references.map(|(white, black)| {
        let [white, black] = [white, black].map(sample);
        (0.5 * (white + black), 0.5 * (white - black))
    });
    let of_bit = |(frames, threshold): &(GrayBit, Threshold)| {
        let level = match threshold {
            Threshold::Complement => None,
            Threshold::Reference => references,
            Threshold::Fringes => fringes,
        };
        let [plain, inverse] = [frames.plain, frames.inverse].map(|frame| frame.map(sample));
        match (plain, inverse, level) {
            (Some(plain), Some(inverse), None) => Some(0.5 * (plain - inverse).abs()),
            (Some(one), _, Some((level, _))) | (None, Some(one), Some((level, _))) => {
                Some((one - level).abs())
            }
            _ => None,
        }
    };
    let strongest = || kernel.bits.iter().filter_map(of_bit).fold(0.0, f32::max);
    let full = references
        .or(fringes)
        .map_or_else(strongest, |(_, half)| half);
    let noise = kernel.join?.noise_factor * job.noise.variance(job.noise.black + full).sqrt();
    let is_lit = full > job.min_modulation.max(2.0 * SURE * noise);
    let contrast = of_bit(&kernel.bits[bit]).filter(|_| is_lit)?;
    Some(contrast / full)
}
