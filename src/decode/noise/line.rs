//! The photon-transfer line, variance = s0 + K mean (EMVA 1288 release 4.0, section 6).
//!
//! Pixels are binned by mean, outliers are removed from each bin, and the line is fitted to the
//! bins by weighted least squares. Two precautions matter for a board in a dark room. Bins have
//! about equal widths in grey value, so that the few lit pixels fill as many bins as their range of
//! values and not just a fraction of one. And the variance of a bin is never assumed to be known
//! better than to a tenth of itself, nor better than the rounding variance: unlit pixels round to
//! one constant and seem to have no noise, and would dominate the fit by their number.

use super::Estimate;

/// Approximate number of bins between the darkest and the brightest mean.
const BINS: f64 = 16.0;
/// Minimum size of a bin: one part in so many of all estimates, and a number of estimates.
const FEWEST: (usize, usize) = (400, 30);
/// Smallest relative standard error assumed for a bin's variance.
const KNOWN: f64 = 0.1;

/// Estimates with similar means.
struct Bin {
    mean: f64,
    variance: f64,
    weight: f64,
}

/// Fits s0 and K of variance = s0 + K mean; `rounding` is the variance of rounding, the lower bound
/// of s0.
pub(super) fn transfer_line(mut estimates: Vec<Estimate>, rounding: f64) -> Option<(f64, f64)> {
    if estimates.len() < 100 {
        return None;
    }
    estimates.sort_by(|a, b| a.mean.total_cmp(&b.mean));
    let bins: Vec<Bin> = chunks(&estimates)
        .into_iter()
        .filter_map(|chunk| Bin::of(chunk, rounding))
        .collect();
    if bins.is_empty() {
        return None;
    }
    let sum = |term: &dyn Fn(&Bin) -> f64| bins.iter().map(|b| b.weight * term(b)).sum::<f64>();
    let weight = sum(&|_| 1.0);
    let x = sum(&|b| b.mean) / weight;
    let y = sum(&|b| b.variance) / weight;
    let xx = sum(&|b| (b.mean - x).powi(2));
    let xy = sum(&|b| (b.mean - x) * (b.variance - y));
    let gain = if xx > 0.0 { (xy / xx).max(0.0) } else { 0.0 };
    let s0 = y - gain * x;
    if s0 < rounding {
        // The line through the rounding variance at zero light.
        let xx = sum(&|b| b.mean.powi(2));
        let xy = sum(&|b| b.mean * (b.variance - rounding));
        let gain = if xx > 0.0 { (xy / xx).max(0.0) } else { 0.0 };
        return Some((rounding, gain));
    }
    Some((s0, gain))
}

/// Splits estimates, ordered by mean, into bins of about equal width with a minimum number each.
fn chunks(mut estimates: &[Estimate]) -> Vec<&[Estimate]> {
    let n = estimates.len();
    let fewest = (n / FEWEST.0).max(FEWEST.1);
    // A thousandth at either end may be outliers.
    let width = (estimates[n - 1 - n / 1000].mean - estimates[n / 1000].mean) / BINS;
    let mut chunks = Vec::new();
    while let Some(first) = estimates.first() {
        let end = estimates.partition_point(|e| e.mean < first.mean + width);
        let mut end = end.max(fewest);
        if estimates.len() < end + fewest {
            end = estimates.len();
        }
        let (chunk, rest) = estimates.split_at(end);
        chunks.push(chunk);
        estimates = rest;
    }
    chunks
}

impl Bin {
    fn of(chunk: &[Estimate], rounding: f64) -> Option<Self> {
        let variance = robust_variance(chunk)?.max(rounding);
        let freedom: f64 = chunk.iter().map(|e| e.freedom).sum();
        let known = variance.powi(2) * (2.0 / freedom + KNOWN.powi(2)) + rounding.powi(2);
        Some(Self {
            mean: chunk.iter().map(|e| e.mean).sum::<f64>() / chunk.len() as f64,
            variance,
            weight: 1.0 / known,
        })
    }
}

/// Mean variance without estimates more than twelve times too large.
fn robust_variance(bin: &[Estimate]) -> Option<f64> {
    let mut sizes: Vec<f64> = bin.iter().map(|e| e.variance).collect();
    sizes.sort_by(f64::total_cmp);
    // The median is 0 if rounding hides the noise: start from the mean then.
    let median = sizes[sizes.len() / 2] * 2.2;
    let mut variance = median.max(sizes[sizes.len() * 9 / 10] / 2.7);
    for _ in 0..5 {
        let kept = bin.iter().filter(|e| e.variance <= 12.0 * variance);
        let (sum, freedom) = kept.fold((0.0, 0.0), |(s, f), e| {
            (s + e.variance * e.freedom, f + e.freedom)
        });
        if freedom == 0.0 {
            return None;
        }
        variance = sum / freedom;
    }
    Some(variance)
}
