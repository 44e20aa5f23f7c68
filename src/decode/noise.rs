//! Estimates the camera's noise from redundancy in the frames, if no calibration provides it.
//!
//! Frames that contain the same information twice differ by noise: a Gray bit and its complement sum
//! to white plus black whatever the bit, and more steps than unknowns leave a residual. If there are
//! enough steps, harmonics of the fringe are removed from the residual, because the projector's
//! response curve causes them. The variances as a function of the mean give a photon-transfer line,
//! variance = s0 + K (mean - black level) (EMVA 1288 release 4.0, section 6).
//!
//! Pixels are binned by mean, outliers are removed from each bin, and the line is fitted to the bins by
//! weighted least squares. Two precautions matter for a board in a dark room. Bins have about equal
//! widths in grey value, so that the few lit pixels fill as many bins as their range of values requires.
//! And the variance of a bin is never assumed to be more precise than a tenth of its value, nor than the
//! rounding variance: unlit pixels round to one constant, seem to have no noise, and would otherwise
//! dominate the fit because there are many of them.

use super::plan::Plan;
use super::steps::FringeSet;
use nalgebra::DMatrix;
use phasmid_geometry::NoiseModel;
use phasmid_pattern::{ImageView, SamplesView};

/// Approximate number of pixels sampled.
const PIXELS: usize = 60_000;
/// Minimum number of distinct values for their greatest common divisor to be meaningful.
const VALUES: usize = 16;
/// Approximate number of bins between the darkest and the brightest mean.
const BINS: f64 = 16.0;
/// Minimum number of estimates in a bin: the total number of estimates divided by the first number, but
/// at least the second number.
const FEWEST: (usize, usize) = (400, 30);
/// Smallest relative standard error assumed for a bin's variance.
const KNOWN: f64 = 0.1;

/// Mean and variance estimated at one pixel.
struct Estimate {
    mean: f64,
    variance: f64,
    /// Degrees of freedom of the variance.
    freedom: f64,
}

/// Estimates with similar means.
struct Bin {
    mean: f64,
    variance: f64,
    weight: f64,
}

/// Estimates a noise model from the frames' redundancy; `None` if there is too little redundancy.
pub fn estimate_noise(plan: &Plan, images: &[ImageView<'_>]) -> Option<NoiseModel> {
    let first = images.iter().find(|image| !image.is_empty())?;
    let pixels = first.width() * first.height();
    let stride = (pixels / PIXELS).max(1);
    let sample = |frame: usize, i: usize| f64::from(images[frame].value(i));
    let full_scale = f64::from(first.full_scale());
    let ceiling = full_scale * 0.98;
    let sources = Sources::of(plan);
    let mut estimates = Vec::new();
    for i in (0..pixels).step_by(stride) {
        sources.at(&|frame| sample(frame, i), ceiling, &mut estimates);
    }
    let rounding = step(images, stride).powi(2) / 12.0;
    let (black, s0, gain) = transfer_line(estimates, rounding)?;
    Some(NoiseModel {
        gain_dn_per_e: gain,
        read_noise_dn: (s0 - 1.0 / 12.0).max(0.0).sqrt(),
        black_level_dn: black,
        saturation_dn: full_scale,
    })
}

/// Quantisation step: the greatest common divisor of the samples' differences. Larger than 1 if
/// samples of fewer bits were shifted or stretched.
fn step(images: &[ImageView<'_>], stride: usize) -> f64 {
    let mut there = vec![false; 1 << 16];
    for image in images {
        match image.samples() {
            SamplesView::U8(s) => s
                .iter()
                .step_by(stride)
                .for_each(|&v| there[usize::from(v)] = true),
            SamplesView::U16(s) => s
                .iter()
                .step_by(stride)
                .for_each(|&v| there[usize::from(v)] = true),
        }
    }
    let values: Vec<usize> = (0..there.len()).filter(|&v| there[v]).collect();
    if values.len() < VALUES {
        return 1.0;
    }
    let divisor = |mut a: usize, mut b: usize| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    values
        .windows(2)
        .fold(0, |all, pair| divisor(all, pair[1] - pair[0])) as f64
}

/// Sources of redundancy. Sums of complements are preferred, because only noise affects them.
enum Sources {
    Sums(Vec<(usize, usize)>),
    Residuals(Vec<Residual>),
    Means(Vec<FringeSet>),
}

impl Sources {
    fn of(plan: &Plan) -> Self {
        let bits = plan.axes.iter().flat_map(|a| &a.gray).flat_map(|g| &g.bits);
        let mut sums: Vec<(usize, usize)> = bits.filter_map(|b| b.plain.zip(b.inverse)).collect();
        sums.extend(plan.references());
        if sums.len() >= 2 {
            return Self::Sums(sums);
        }
        let sets: Vec<&FringeSet> = plan.axes.iter().flat_map(|a| &a.sets).collect();
        let residuals: Vec<_> = sets.iter().filter_map(|set| residual(set)).collect();
        if !residuals.is_empty() {
            return Self::Residuals(residuals);
        }
        Self::Means(sets.into_iter().cloned().collect())
    }

    fn at(&self, sample: &dyn Fn(usize) -> f64, ceiling: f64, out: &mut Vec<Estimate>) {
        match self {
            Self::Sums(pairs) => {
                let n = pairs.len() as f64;
                let mut values = Vec::with_capacity(pairs.len());
                for &(a, b) in pairs {
                    let (a, b) = (sample(a), sample(b));
                    if a.max(b) > ceiling {
                        return;
                    }
                    values.push(a + b);
                }
                let mean = values.iter().sum::<f64>() / n;
                let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
                out.push(Estimate {
                    mean: 0.5 * mean,
                    variance: 0.5 * squares / (n - 1.0),
                    freedom: n - 1.0,
                });
            }
            Self::Residuals(sets) => {
                let mut values = Vec::new();
                for Residual { frames, basis } in sets {
                    values.clear();
                    values.extend(frames.iter().map(|&f| sample(f)));
                    if values.iter().any(|&v| v > ceiling) {
                        continue;
                    }
                    let along = |vector: &Vec<f64>| {
                        let products = vector.iter().zip(&values).map(|(a, b)| a * b);
                        products.sum::<f64>().powi(2)
                    };
                    let freedom = basis.len() as f64;
                    out.push(Estimate {
                        mean: values.iter().sum::<f64>() / values.len() as f64,
                        variance: basis.iter().map(along).sum::<f64>() / freedom,
                        freedom,
                    });
                }
            }
            Self::Means(sets) => {
                for pair in sets.windows(2) {
                    let [(a, va), (b, vb)] = [&pair[0], &pair[1]].map(|set| {
                        let values: Vec<f64> = set.frames.iter().map(|&f| sample(f)).collect();
                        let weight: f64 = set.weights.iter().map(|w| w[0] * w[0]).sum();
                        (set.solve(&values)[0], weight)
                    });
                    out.push(Estimate {
                        mean: 0.5 * (a + b),
                        variance: (a - b).powi(2) / (va + vb),
                        freedom: 1.0,
                    });
                }
            }
        }
    }
}

/// The residual of a fringe with harmonics.
struct Residual {
    frames: Vec<usize>,
    /// Orthonormal vectors over the frames.
    basis: Vec<Vec<f64>>,
}

fn residual(set: &FringeSet) -> Option<Residual> {
    let n = set.phases.len();
    // At most three harmonics, as long as at least one degree of freedom in four remains.
    for harmonics in (1..=3usize.min(n.saturating_sub(2) / 2)).rev() {
        let basis = DMatrix::from_fn(n, 2 * harmonics + 1, |i, j| {
            let order = j.div_ceil(2) as f64;
            if j % 2 == 1 {
                (order * set.phases[i]).cos()
            } else if j == 0 {
                1.0
            } else {
                (order * set.phases[i]).sin()
            }
        });
        let normal = basis.transpose() * &basis;
        if basis.ncols() >= n || normal.symmetric_eigenvalues().min() < 1e-6 * n as f64 {
            continue;
        }
        let inverse = normal.try_inverse()?;
        let project = DMatrix::identity(n, n) - &basis * inverse * basis.transpose();
        // The eigenvalues along the residual are 1, all others 0.
        let eigen = project.symmetric_eigen();
        let vectors = eigen.eigenvectors.column_iter().zip(&eigen.eigenvalues);
        let along = vectors.filter(|(_, value)| **value > 0.5);
        return Some(Residual {
            frames: set.frames.clone(),
            basis: along
                .map(|(vector, _)| vector.iter().copied().collect())
                .collect(),
        });
    }
    None
}

/// Fits s0 and K of variance = s0 + K (mean - black); `rounding` is the variance of rounding, the lower
/// bound of s0. If the fitted s0 is below that bound, the black level is the mean at which the line
/// crosses the bound, limited to 0 up to the darkest mean. If not, the black level is set to 0, and s0
/// includes its effect.
fn transfer_line(mut estimates: Vec<Estimate>, rounding: f64) -> Option<(f64, f64, f64)> {
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
    if s0 >= rounding {
        return Some((0.0, s0, gain));
    }
    let darkest = bins.first().map_or(0.0, |bin| bin.mean);
    let black = match gain > 0.0 {
        true => ((rounding - s0) / gain).clamp(0.0, darkest.max(0.0)),
        false => 0.0,
    };
    let xx = sum(&|b| (b.mean - black).powi(2));
    let xy = sum(&|b| (b.mean - black) * (b.variance - rounding));
    let gain = if xx > 0.0 { (xy / xx).max(0.0) } else { 0.0 };
    Some((black, rounding, gain))
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
    // If rounding hides the noise, the median is 0, and the iteration starts from the ninth decile.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_below_zero_have_no_black_level() {
        // Unequal steps may have a negative mean where only one of them has light.
        let estimate = |i: u32| {
            let mean = 0.03 * f64::from(i) - 12.0;
            Estimate {
                mean,
                variance: (0.4 * (mean - 30.0)).max(0.08),
                freedom: 1.0,
            }
        };
        let (black, s0, gain) = transfer_line((0..4000).map(estimate).collect(), 0.08).unwrap();
        assert_eq!((black, s0), (0.0, 0.08));
        assert!((0.01..0.4).contains(&gain), "{gain}");
    }
}
