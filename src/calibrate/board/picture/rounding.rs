//! What rounding leaves in the mean of frames that all show the same.
//!
//! Noise makes a converter's rounding different from frame to frame, and the mean of many frames has
//! 1/12 of a squared number over their count. Where a pixel is the same in all frames and its noise is
//! well below one number, they are all rounded alike, and no number of them helps.

use std::f32::consts::PI;

/// Terms of the series.
const TERMS: u16 = 4;

/// Frames whose samples differ by less than this, in digital numbers, beside six of their standard
/// deviations, show the same.
const SAME_DN: f32 = 1.5;

/// What counts of a pixel on an outline is how it lies between ink and paper, whose levels are rounded
/// too: of a share c of ink the variance is 1 + c^2 + (1 - c)^2 times the pixel's own, and 5/3 on average.
pub(super) const ON_OUTLINES: f32 = 5.0 / 3.0;

/// Variance, in squared digital numbers, of what rounding leaves in the mean of any number of samples
/// with this variance before rounding, over all fractions that their mean may have: the harmonics of
/// the rounding error, each lessened by the noise's characteristic function (Widrow and Kollar,
/// "Quantization Noise", 2008, section 4.5).
pub(super) fn left_by_rounding(variance: f32) -> f32 {
    (1..=TERMS)
        .map(|k| (2.0 * PI * f32::from(k)).powi(2))
        .map(|square| (-variance * square).exp() * 2.0 / square)
        .sum()
}

/// Whether samples from `low` to `high` with this variance before rounding may all be of one level.
pub(super) fn same(low: f32, high: f32, variance: f32) -> bool {
    high - low < SAME_DN + 6.0 * variance.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_what_rounding_leaves() {
        // The series' rest is 5 % of 1/12 at four terms of the unlessened harmonics.
        assert!((left_by_rounding(0.0) * 12.0 - 0.865).abs() < 1e-3);
        for sigma in [0.15_f64, 0.25, 0.4] {
            // The expected rounding error at each fraction, by the normal density on a fine grid.
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
