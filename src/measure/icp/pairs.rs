//! Pairs points with the tangent planes of their closest surface points, and weights outliers down
//! to zero.

use crate::surface::Foot;
use glam::DVec3;
use phasmid_core::statistics::{BIWEIGHT_END, MEDIAN_OF_NORMAL};

/// A point, the normal at its closest surface point, and its distance to the tangent plane at that
/// surface point.
#[derive(Clone, Copy)]
pub(super) struct Pair {
    pub(super) point: DVec3,
    pub(super) normal: DVec3,
    pub(super) residual: f64,
}

/// Pairs points with their planes; points beside the surface are dropped.
pub(super) fn pairs(points: &[DVec3], feet: &[Option<Foot>]) -> Vec<Pair> {
    points
        .iter()
        .zip(feet)
        .filter_map(|(&point, foot)| {
            let foot = foot.as_ref()?;
            let residual = (point - foot.point).dot(foot.normal);
            // If the closest point is on a border, the point lies beside the surface instead of
            // over it.
            let over = residual.abs() >= 0.7 * foot.distance_mm || foot.distance_mm < 1e-9;
            (over && foot.normal != DVec3::ZERO).then_some(Pair {
                point,
                normal: foot.normal,
                residual,
            })
        })
        .collect()
}

/// Six unknowns of a rigid motion.
pub(super) const UNKNOWNS: usize = 6;

/// Distances in millimetres that separate inliers from outliers.
#[derive(Clone, Copy)]
pub(super) struct Scale {
    /// Standard deviation of the residuals, from their median.
    pub(super) robust: f64,
    /// Final cutoff: pairs with a larger residual have zero weight in the last steps.
    pub(super) cutoff: f64,
    /// Cutoff for the first step: four times the RMS of the best 99 %. In a flat scene the residuals of
    /// nearly all points are 0 at this step; the few points on slopes, which alone determine the
    /// motion, must not be rejected.
    pub(super) wide: f64,
}

impl Scale {
    /// Derives the limits from at least one pair; `floor` is the smallest robust scale.
    ///
    /// A motion can fit any six pairs exactly, so the median skips the six smallest residuals.
    pub(super) fn new(pairs: &[Pair], floor: f64) -> Self {
        let mut sizes: Vec<f64> = pairs.iter().map(|p| p.residual.abs()).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        let n = sizes.len();
        let robust = (sizes[((n + UNKNOWNS) / 2).min(n - 1)] / MEDIAN_OF_NORMAL).max(floor);
        let best = &sizes[..(n * 99).div_ceil(100)];
        let rms = (best.iter().map(|r| r * r).sum::<f64>() / best.len() as f64).sqrt();
        let cutoff = BIWEIGHT_END * robust;
        Self {
            robust,
            cutoff,
            wide: cutoff.max(4.0 * rms),
        }
    }
}

/// The pairs with their weights, and the cost.
pub(super) struct Weighed {
    /// Pairs with a positive weight.
    pub(super) kept: Vec<(Pair, f64)>,
    /// Sum of the loss over all points in square millimetres. Rejected and `unpaired` points have the
    /// largest loss.
    pub(super) cost: f64,
}

/// Weights pairs by `(1 - (r / cutoff)^2)^2`, and by zero beyond the cutoff.
pub(super) fn weigh(pairs: &[Pair], cutoff: f64, unpaired: usize) -> Weighed {
    let (mut kept, mut cost) = (Vec::with_capacity(pairs.len()), unpaired as f64);
    for pair in pairs {
        let rest = (1.0 - (pair.residual / cutoff).powi(2)).max(0.0);
        cost += 1.0 - rest.powi(3);
        if rest > 0.0 {
            kept.push((*pair, rest * rest));
        }
    }
    Weighed {
        kept,
        cost: cost * cutoff * cutoff / 6.0,
    }
}
