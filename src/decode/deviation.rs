//! A robust standard deviation, insensitive to a few outliers.

/// Residuals beyond this many standard deviations are outliers.
const CLIP: f64 = 3.0;
/// Fraction of the variance of a normal distribution within [`CLIP`] standard deviations.
const WITHIN: f64 = 0.9733;
/// Iterations of clipping.
const ROUNDS: usize = 4;

/// Returns the standard deviation of residuals, without residuals beyond three standard deviations.
/// `sizes` are the absolute values of at least one residual, in any order. Iteration starts from the
/// median, or from `first` if that is larger, since integer residuals may have a median of 0. The result
/// is at least `least`.
pub fn of_most(sizes: &mut [f64], first: f64, least: f64) -> f64 {
    let middle = sizes.len() / 2;
    // The median of absolute values is 0.6745 standard deviations. For integer residuals the median is
    // coarse, hence the iterations.
    let median = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1 / 0.6745;
    let mut deviation = median.max(first);
    for _ in 0..ROUNDS {
        let (mut sum, mut n) = (0.0, 0.0);
        for size in sizes.iter() {
            let kept = f64::from(u8::from(*size < CLIP * deviation));
            sum += kept * size * size;
            n += kept;
        }
        deviation = (sum / WITHIN / f64::max(n, 1.0)).sqrt().max(least);
    }
    deviation
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Normal deviates from evenly spread pairs (Box and Muller).
    fn normal(n: u32, deviation: f64) -> Vec<f64> {
        let pair = |i| {
            let u = (f64::from(i) + 0.5) / f64::from(n);
            let v = f64::from(i) * 0.618_033_988_75 % 1.0;
            deviation * (-2.0 * u.ln()).sqrt() * (TAU * v).cos()
        };
        (0..n).map(pair).collect()
    }

    #[test]
    fn deviation_of_normal_noise_is_robust_to_outliers() {
        let mut sizes: Vec<f64> = normal(20_000, 2.5).iter().map(|v| v.abs()).collect();
        let clean = of_most(&mut sizes, 0.5, 0.3);
        assert!((clean / 2.5 - 1.0).abs() < 0.01, "{clean}");
        // One in fifty is an outlier.
        sizes[..400].fill(1e4);
        let damaged = of_most(&mut sizes, 0.5, 0.3);
        assert!((damaged / 2.5 - 1.0).abs() < 0.03, "{damaged}");
    }

    #[test]
    fn integers_that_are_mostly_zero_have_a_deviation() {
        let mut sizes: Vec<f64> = normal(20_000, 0.6)
            .iter()
            .map(|v| v.round().abs())
            .collect();
        // Rounding adds 1/12 to the variance.
        let want = (0.36f64 + 1.0 / 12.0).sqrt();
        let found = of_most(&mut sizes, 1.0, 0.3);
        assert!(
            (found / want - 1.0).abs() < 0.05,
            "{found}, expected {want}"
        );
        assert_eq!(of_most(&mut [0.0; 9], 1.0, 0.3), 0.3);
    }
}
