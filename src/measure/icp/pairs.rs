//! Pairs points with the tangent planes of their closest surface points, and rejects outliers.

use crate::surface::Foot;
use glam::DVec3;

/// A point, the normal at its closest surface point and its distance to the tangent plane there.
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

/// Outlier limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Clip {
    /// Four times the RMS of the best 99 %. Before convergence, most points of a flat scene have no
    /// residual, and the few on slopes, which alone determine the motion, must not be rejected.
    Wide,
    /// Three standard deviations, estimated from the median (P. Rousseeuw and A. Leroy, "Robust
    /// Regression and Outlier Detection", 1987).
    Narrow,
}

impl Clip {
    /// Returns the pairs within the limit, which is derived from the pairs themselves.
    pub(super) fn keep(self, mut pairs: Vec<Pair>) -> Vec<Pair> {
        let mut sizes: Vec<f64> = pairs.iter().map(|p| p.residual.abs()).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        if sizes.is_empty() {
            return pairs;
        }
        let limit = match self {
            Self::Wide => {
                let best = &sizes[..(sizes.len() * 99).div_ceil(100)];
                4.0 * (best.iter().map(|r| r * r).sum::<f64>() / best.len() as f64).sqrt()
            }
            Self::Narrow => 3.0 * 1.4826 * sizes[sizes.len() / 2],
        };
        // Below a nanometre residuals are rounding errors, so all pairs are kept.
        let limit = limit.max(1e-6);
        pairs.retain(|p| p.residual.abs() <= limit);
        pairs
    }
}
