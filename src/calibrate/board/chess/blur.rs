//! Estimates the image's blur from all its corners together.
//!
//! If a corner's blur is narrower than a pixel and its edges run along the pixel rows, the corner
//! contains no information on the blur, yet its fitted position depends on the assumed blur. All
//! corners of an image have the same blur, or a blur that varies with the board's distance.
//! Therefore the corners that determine the blur provide the prior for the others.

/// Prior for a corner's blur: variance of the blur in pixels squared, and standard deviation of
/// that variance (0 fixes the blur).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Blur {
    pub(super) variance: f64,
    pub(super) spread: f64,
}

/// A variance of the blur below this is treated as no blur.
const NONE: f64 = 1e-4;
/// Corners are taken to have different blurs if the upper quartile of their differences from the
/// median blur, in standard deviations, exceeds this. Noise alone gives 1.15.
const VARIES: f64 = 3.0;

impl Blur {
    /// Prior before any corner has been measured: a typical blur, with almost no weight.
    pub(super) const UNKNOWN: Self = Self {
        variance: 0.3,
        spread: 3.0,
    };
    /// Minimum blur variance, in pixels squared, that is visible in an edge at any position
    /// relative to the pixels.
    pub(super) const SEEN: f64 = 0.01;

    /// Combines the blur variances of several corners, each with its standard deviation, into one
    /// prior: their weighted median, with a standard deviation above 0 only if the corners differ
    /// by more than noise.
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
