//! What the corners of a picture tell of its blur together.
//!
//! A corner whose edges run along the pixels' rows, sharper than a pixel, says nothing of it, and
//! where it lies hangs on the blur that is assumed. A picture has one blur, or one that varies with
//! the board's distance; the corners that see it tell it for those that do not.

/// The blur's variance in pixels squared as it is known, and a standard deviation of that; 0 takes it
/// as it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Blur {
    pub(super) variance: f64,
    pub(super) spread: f64,
}

/// A variance of the blur below this is none.
const NONE: f64 = 1e-4;
/// Upper quartile of the deviations from the median in standard deviations (1.15 by noise alone) above
/// which corners differ.
const VARIES: f64 = 3.0;

impl Blur {
    /// Before anything is known: an ordinary one, with next to no weight.
    pub(super) const UNKNOWN: Self = Self {
        variance: 0.3,
        spread: 3.0,
    };
    /// Variance of a blur that edges in any place show.
    pub(super) const SEEN: f64 = 0.01;

    /// What corners tell by their blurs' variances and the standard deviations of those: the weighted
    /// median, with a spread where they differ by more than noise.
    pub(super) fn told_by(corners: impl Iterator<Item = [f64; 2]>) -> Self {
        let mut told: Vec<[f64; 2]> = corners
            .filter(|[variance, sigma]| variance.is_finite() && *sigma > 0.0)
            .collect();
        told.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let half = 0.5 * told.iter().map(|[_, sigma]| 1.0 / sigma).sum::<f64>();
        let mut sum = 0.0;
        let middle = told.iter().find(|[_, sigma]| {
            sum += 1.0 / sigma;
            sum >= half
        });
        let Some(&[variance, _]) = middle else {
            return Self::UNKNOWN;
        };
        let upper = |value: &dyn Fn(&[f64; 2]) -> f64| {
            let mut values: Vec<f64> = told.iter().map(value).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len() * 3 / 4).copied().unwrap_or(0.0)
        };
        let off = |corner: &[f64; 2]| (corner[0] - variance).abs();
        let varies = upper(&|corner| off(corner) / corner[1]) > VARIES;
        let spread = if varies { 2.0 * upper(&off) } else { 0.0 };
        let none = variance < NONE && !varies;
        Self {
            variance: if none { 0.0 } else { variance },
            spread,
        }
    }
}
