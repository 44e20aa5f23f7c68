//! Robust statistics, and the nodes of Gauss-Legendre quadrature.

use std::cmp::Ordering;
use std::f64::consts::PI;

/// Median of the absolute value of a standard normal variable.
pub const MEDIAN_OF_NORMAL: f64 = 0.674_489_750_196_081_7;
/// Residual, in standard deviations, from which the biweight is zero. With this value the biweight has
/// 95 % of the efficiency of least squares for normal errors (P. Huber and E. Ronchetti, "Robust
/// Statistics", 2009).
pub const BIWEIGHT_END: f64 = 4.685;

/// Numbers that [`median`] orders: `f32` and `f64`.
pub trait Real: Copy {
    /// Total order, as `f64::total_cmp`.
    fn order(&self, other: &Self) -> Ordering;
    /// Whether the number is neither NaN nor infinite.
    fn is_finite(&self) -> bool;
}

impl Real for f32 {
    fn order(&self, other: &Self) -> Ordering {
        self.total_cmp(other)
    }
    fn is_finite(&self) -> bool {
        Self::is_finite(*self)
    }
}

impl Real for f64 {
    fn order(&self, other: &Self) -> Ordering {
        self.total_cmp(other)
    }
    fn is_finite(&self) -> bool {
        Self::is_finite(*self)
    }
}

/// Returns the median; of an even number of values, the upper of the two middle ones. Returns
/// `None` if there are no values. Reorders `values`.
pub fn median<T: Real>(values: &mut [T]) -> Option<T> {
    let middle = values.len() / 2;
    let order = |a: &T, b: &T| a.order(b);
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, order).1)
}

/// Returns the [`median`] of the finite values.
pub fn finite_median<T: Real>(values: impl IntoIterator<Item = T>) -> Option<T> {
    let finite = values.into_iter().filter(T::is_finite);
    median(&mut finite.collect::<Vec<_>>())
}

/// Returns the robust standard deviation of normal errors from their absolute values `sizes`; `None` if
/// there are no values. Reorders `sizes`.
pub fn normal_scale(sizes: &mut [f64]) -> Option<f64> {
    Some(median(sizes)? / MEDIAN_OF_NORMAL)
}

/// Biweight of A. Beaton and J. Tukey (Technometrics 16, 1974) of a residual in standard deviations; 0 for
/// NaN.
#[inline]
pub fn biweight(residual: f64) -> f64 {
    let rest = 1.0 - (residual / BIWEIGHT_END).powi(2);
    // `f64::max` ignores NaN, so the result is 0 for NaN.
    rest.max(0.0).powi(2)
}

/// Returns nodes and weights of Gauss-Legendre quadrature on [-1, 1], from the largest node down, by
/// Newton's method on the recurrence of the polynomials.
pub fn gauss_legendre(count: usize) -> Vec<(f64, f64)> {
    let node = |i: usize| {
        let mut x = (PI * (i as f64 + 0.75) / (count as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..20 {
            let (mut before, mut at) = (1.0, x);
            for k in 2..=count {
                let k = k as f64;
                (before, at) = (at, ((2.0 * k - 1.0) * x * at - (k - 1.0) * before) / k);
            }
            slope = count as f64 * (before - x * at) / (1.0 - x * x);
            x -= at / slope;
        }
        (x, 2.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..count).map(node).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_are_the_upper_middle_value() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&mut [4.0f32, 1.0, 2.0, 3.0]), Some(3.0));
        assert_eq!(median::<f64>(&mut []), None);
        let values = [f64::NAN, 1.0, f64::INFINITY, 5.0, 3.0];
        assert_eq!(finite_median(values), Some(3.0));
        assert_eq!(finite_median([f32::NAN]), None);
    }

    #[test]
    fn biweight_falls_to_zero() {
        assert_eq!(biweight(0.0), 1.0);
        assert!(biweight(2.0) > biweight(3.0) && biweight(3.0) > 0.0);
        assert_eq!(biweight(4.7), 0.0);
        assert_eq!(biweight(f64::NAN), 0.0);
    }

    #[test]
    fn quadrature_is_exact_for_polynomials() {
        // Abramowitz and Stegun, table 25.4.
        let (node, weight) = gauss_legendre(5)[0];
        assert!((node - 0.906_179_845_938_664).abs() < 1e-15);
        assert!((weight - 0.236_926_885_056_189).abs() < 1e-15);
        for count in [1, 2, 7, 20] {
            let power = 2 * (count as i32) - 2;
            let sum: f64 = gauss_legendre(count)
                .iter()
                .map(|(x, w)| w * x.powi(power))
                .sum();
            let exact = 2.0 / f64::from(power + 1);
            assert!((sum / exact - 1.0).abs() < 1e-13, "{count}: {sum}");
        }
    }
}
