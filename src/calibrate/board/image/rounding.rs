//! Rounding error of the mean of frames that all show the same level.
//!
//! Noise makes the rounding of a converter vary from frame to frame, so that the mean of n frames
//! has a rounding variance of 1 / (12 n) DN squared. If a pixel has the same level in all frames
//! and its noise is well below 1 DN, all frames round alike, and averaging does not reduce the
//! error.

use std::f32::consts::PI;

/// Number of terms of the series.
const TERMS: u16 = 4;

/// Frames whose samples differ by less than this, in DN, plus six standard deviations, are taken to
/// show the same level.
const SAME_DN: f32 = 1.5;

/// Factor by which a pixel's own rounding variance is multiplied. A fit uses the position of an
/// outline pixel's level between the levels of ink and paper, which are rounded too. With a
/// fraction c of ink the factor is 1 + c^2 + (1 - c)^2, on average over c 5/3.
pub(super) const ON_OUTLINES: f32 = 5.0 / 3.0;

/// Rounding variance, in DN squared, of the mean of any number of samples of the same level,
/// averaged over all fractions of that level; `variance` is the variance of a sample before
/// rounding. It sums the harmonics of the rounding error, each attenuated by the noise's
/// characteristic function (Widrow and Kollar, "Quantization Noise", 2008, section 4.5).
pub(super) fn left_by_rounding(variance: f32) -> f32 {
    (1..=TERMS)
        .map(|k| (2.0 * PI * f32::from(k)).powi(2))
        .map(|square| (-variance * square).exp() * 2.0 / square)
        .sum()
}

/// Whether samples between `low` and `high` may all have the same true level; `variance` is a
/// sample's variance before rounding.
pub(super) fn same(low: f32, high: f32, variance: f32) -> bool {
    high - low < SAME_DN + 6.0 * variance.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_equals_integrated_rounding_error() {
        // Without noise the variance is 1/12; four terms of the series give 0.865 of it.
        assert!((left_by_rounding(0.0) * 12.0 - 0.865).abs() < 1e-3);
        for sigma in [0.15_f64, 0.25, 0.4] {
            // Expected rounding error at each fraction, integrated over the normal density.
            let mut sum = 0.0;
            for f in 0..200 {
                let level = f64::from(f) / 200.0;
                let (mut mean, mut total) = (0.0, 0.0);
                for z in -600..=600 {
                    let z = f64::from(z) / 100.0;
                    let weight = (-z * z / 2.0).exp();
                    mean += weight * ((level + sigma * z).round() - level);
                    total += weight;
                }
                sum += (mean / total).powi(2) / 200.0;
            }
            let series = f64::from(left_by_rounding((sigma * sigma) as f32));
            assert!((series / sum - 1.0).abs() < 0.02, "{sigma}: {series} {sum}");
        }
    }
}
