//! The deviation of most residuals, whatever a few of them are.

/// Deviations from which on a residual is none of the usual ones.
const CLIP: f64 = 3.0;
/// The part of its variance that a normal distribution has within [`CLIP`] deviations.
const WITHIN: f64 = 0.9733;
/// Rounds of clipping.
const ROUNDS: usize = 4;

/// Standard deviation of residuals, by their sizes in any order, at least one of them, without those
/// beyond three of it. The median begins, and is held to be no less than `first`: residuals of
/// whole numbers may have a median of 0. Nothing below `least` is believed.
pub fn of_most(sizes: &mut [f64], first: f64, least: f64) -> f64 {
    let middle = sizes.len() / 2;
    // 0.6745 of a deviation is the median of sizes. It alone is as coarse as whole numbers are.
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

    /// Normal deviates of a deviation, by Box and Muller from evenly spread pairs.
    fn normal(n: u32, deviation: f64) -> Vec<f64> {
        let pair = |i| {
            let u = (f64::from(i) + 0.5) / f64::from(n);
            let v = f64::from(i) * 0.618_033_988_75 % 1.0;
            deviation * (-2.0 * u.ln()).sqrt() * (TAU * v).cos()
        };
        (0..n).map(pair).collect()
    }

    #[test]
    fn it_is_that_of_normal_noise_whatever_a_few_are() {
        let mut sizes: Vec<f64> = normal(20_000, 2.5).iter().map(|v| v.abs()).collect();
        let clean = of_most(&mut sizes, 0.5, 0.3);
        assert!((clean / 2.5 - 1.0).abs() < 0.01, "{clean}");
        // One in fifty is far off.
        sizes[..400].fill(1e4);
        let damaged = of_most(&mut sizes, 0.5, 0.3);
        assert!((damaged / 2.5 - 1.0).abs() < 0.03, "{damaged}");
    }

    #[test]
    fn whole_numbers_of_which_most_are_zero_have_one() {
        let mut sizes: Vec<f64> = normal(20_000, 0.6)
            .iter()
            .map(|v| v.round().abs())
            .collect();
        // Rounding adds a twelfth.
        let want = (0.36f64 + 1.0 / 12.0).sqrt();
        let found = of_most(&mut sizes, 1.0, 0.3);
        assert!((found / want - 1.0).abs() < 0.05, "{found}, want {want}");
        assert_eq!(of_most(&mut [0.0; 9], 1.0, 0.3), 0.3);
    }
}
