//! Decodes the Gray bits of a row.

use super::job::{AxisKernel, Job, Scratch};
use crate::gray::Threshold;
use crate::sample::Sample;

/// Decodes the Gray bits, and computes the noise of a sample and, without white and black, the half
/// contrast.
#[inline(always)]
pub(super) fn gray_row<'f, T: Sample>(
    job: &Job<'_, T>,
    kernel: &AxisKernel,
    row: &impl Fn(usize) -> &'f [T],
    scratch: &mut Scratch,
) {
    if kernel.bits.is_empty() {
        return;
    }
    let n = job.width;
    let Scratch {
        sets,
        gray,
        middle,
        half,
        sigma,
        ..
    } = scratch;
    let set = sets.first().filter(|_| !kernel.sets.is_empty());
    gray.reset(n);
    if job.references.is_none() {
        match set {
            Some(set) => half.copy_from_slice(&set.modulation),
            None => half.fill(0.0),
        }
    }
    let unused = job.unused_bits[kernel.axis as usize];
    for (bit, (frames, threshold)) in kernel.bits[unused..].iter().enumerate() {
        match (threshold, frames.plain, frames.inverse) {
            (Threshold::Complement, Some(plain), Some(inverse)) => {
                let (plain, inverse) = (row(plain), row(inverse));
                gray.add_pair(bit, plain, inverse);
                if job.references.is_none() && set.is_none() {
                    // The strongest bit gives the contrast, and the mean of a bit and its complement
                    // gives the threshold.
                    for i in 0..n {
                        let (p, q) = (plain[i].dn(), inverse[i].dn());
                        half[i] = half[i].max(0.5 * (p - q).abs());
                        middle[i] = 0.5 * (p + q);
                    }
                }
            }
            (threshold, plain, inverse) => {
                let level: &[f32] = match (threshold, set) {
                    (Threshold::Fringes, Some(set)) => &set.mean,
                    _ => middle,
                };
                match (plain, inverse) {
                    (Some(frame), _) => gray.add_single(bit, row(frame), level, 1.0),
                    (None, Some(frame)) => gray.add_single(bit, row(frame), level, -1.0),
                    (None, None) => {}
                }
            }
        }
    }
    let mean = set.map_or(&middle[..n], |set| &set.mean[..n]);
    let sigma = &mut sigma[..n];
    for i in 0..n {
        sigma[i] = job.noise.variance(mean[i]).sqrt();
    }
}
