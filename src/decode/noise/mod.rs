//! Estimates the camera's noise from redundancy in the frames, if no calibration provides it.
//!
//! Frames that contain the same information twice differ by noise: a Gray bit and its complement sum
//! to white plus black whatever the bit, and more steps than unknowns leave a residual. If there are
//! enough steps, harmonics of the fringe are removed from the residual, because the projector's
//! response curve causes them. The variances as a function of the mean give a photon-transfer line
//! (`line`).

mod line;

use super::plan::Plan;
use super::steps::FringeSet;
use line::transfer_line;
use nalgebra::{DMatrix, DVector};
use phasmid_geometry::NoiseModel;
use phasmid_pattern::{ImageView, SamplesView};

/// Approximate number of pixels sampled.
const PIXELS: usize = 60_000;
/// Minimum number of distinct values for their greatest common divisor to be meaningful.
const VALUES: usize = 16;

/// Mean and variance estimated at one pixel.
struct Estimate {
    mean: f64,
    variance: f64,
    /// Degrees of freedom of the variance.
    freedom: f64,
}

/// Estimates a noise model from the frames' redundancy; `None` if there is too little.
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
    let (s0, gain) = transfer_line(estimates, rounding)?;
    Some(NoiseModel {
        gain_dn_per_e: gain,
        read_noise_dn: (s0 - 1.0 / 12.0).max(0.0).sqrt(),
        black_level_dn: 0.0,
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
    Residuals(Vec<(Vec<usize>, DMatrix<f64>, f64)>),
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
        let residuals: Vec<_> = sets.iter().filter_map(|set| annihilator(set)).collect();
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
                for (frames, project, freedom) in sets {
                    let values: Vec<f64> = frames.iter().map(|&f| sample(f)).collect();
                    if values.iter().any(|&v| v > ceiling) {
                        continue;
                    }
                    let values = DVector::from_vec(values);
                    out.push(Estimate {
                        mean: values.mean(),
                        variance: (project * &values).norm_squared() / freedom,
                        freedom: *freedom,
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

/// Frames, projection onto the residual of a fringe with harmonics, and its rank.
fn annihilator(set: &FringeSet) -> Option<(Vec<usize>, DMatrix<f64>, f64)> {
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
        let freedom = n as f64 - basis.ncols() as f64;
        let normal = basis.transpose() * &basis;
        if freedom < 1.0 || normal.symmetric_eigenvalues().min() < 1e-6 * n as f64 {
            continue;
        }
        let inverse = normal.try_inverse()?;
        let project = DMatrix::identity(n, n) - &basis * inverse * basis.transpose();
        return Some((set.frames.clone(), project, freedom));
    }
    None
}
