//! Which points pull, and where to: their feet's planes, outliers left out.

use crate::surface::Foot;
use glam::DVec3;

/// A point, its foot's normal and its distance to the plane there.
#[derive(Clone, Copy)]
pub(super) struct Pair {
    pub(super) point: DVec3,
    pub(super) normal: DVec3,
    pub(super) residual: f64,
}

/// Points with the planes they belong to; those beside the surface have none.
pub(super) fn pairs(points: &[DVec3], feet: &[Option<Foot>]) -> Vec<Pair> {
    points
        .iter()
        .zip(feet)
        .filter_map(|(&point, foot)| {
            let foot = foot.as_ref()?;
            let residual = (point - foot.point).dot(foot.normal);
            // A foot on a border: the point lies beside the surface, not over it.
            let over = residual.abs() >= 0.7 * foot.distance_mm || foot.distance_mm < 1e-9;
            (over && foot.normal != DVec3::ZERO).then_some(Pair {
                point,
                normal: foot.normal,
                residual,
            })
        })
        .collect()
}

/// Which pairs count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Clip {
    /// Up to four times the RMS of the best 99 %. On the way, most points of a flat scene have no
    /// residual at all, and the few on slopes, which alone tell where to go, must not pass for
    /// outliers.
    Wide,
    /// Up to three standard deviations, these from the median (P. Rousseeuw and A. Leroy, "Robust
    /// Regression and Outlier Detection", 1987).
    Narrow,
}

impl Clip {
    /// The pairs within the limit that they set themselves.
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
        // Below a nanometre residuals are rounding, and all of them count.
        let limit = limit.max(1e-6);
        pairs.retain(|p| p.residual.abs() <= limit);
        pairs
    }
}
