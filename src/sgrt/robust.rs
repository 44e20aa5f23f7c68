//! Tukey's biweight, the residual scale, and the resulting covariance inflation.

use phasmid_core::statistics::{BIWEIGHT_END, MEDIAN_OF_NORMAL};

/// 80th percentile of the absolute value of a standard normal variable.
const Q80: f64 = 1.281_551_565_544_600_4;

/// How to estimate the scale of the residuals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Spread {
    /// By the 80th percentile. Far from the solution most residuals of a flat surface are small in
    /// any pose; the large residuals on slopes, which alone show the direction, must not count as
    /// outliers.
    Wide,
    /// By the median absolute residual: up to half of the points may be outliers.
    Narrow,
}

impl Spread {
    /// Computes the scale of residuals given in units of their standard deviations. Reorders them.
    pub(super) fn scale(self, residuals: &mut [f64]) -> f64 {
        let (rank, of_one) = match self {
            Self::Wide => (0.8, Q80),
            Self::Narrow => (0.5, MEDIAN_OF_NORMAL),
        };
        if residuals.is_empty() {
            return 1.0;
        }
        let at = (residuals.len() as f64 * rank) as usize;
        let at = at.min(residuals.len() - 1);
        residuals.select_nth_unstable_by(at, f64::total_cmp).1.abs() / of_one
    }
}

/// Sums over inliers for the covariance inflation n sum(psi^2) / sum(psi')^2 (Huber and Ronchetti,
/// equation 7.81), where psi is the influence function in units of standard deviations. The factor is
/// the ratio of actual to claimed residual variance, divided by the efficiency.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Inflation {
    count: f64,
    squares: f64,
    slopes: f64,
    weights: f64,
}

impl Inflation {
    /// Adds a residual in standard deviations; `scale` is the scale of the biweight.
    #[inline]
    pub(super) fn add(&mut self, residual: f64, scale: f64) {
        let x = residual / (scale * BIWEIGHT_END);
        if x.abs() < 1.0 {
            let y = 1.0 - x * x;
            let psi = residual * y * y;
            self.count += 1.0;
            self.squares += psi * psi;
            self.slopes += y * (1.0 - 5.0 * x * x);
            self.weights += y * y;
        }
    }

    pub(super) fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.squares += other.squares;
        self.slopes += other.slopes;
        self.weights += other.weights;
    }

    /// Factor for the inverse of the system in which every row has its biweight, for this number of
    /// unknowns. A scan never counts as more precise than its stated noise.
    pub(super) fn factor(&self, unknowns: usize) -> f64 {
        let freedom = (self.count - unknowns as f64).max(1.0);
        let slope = self.slopes / self.count.max(1.0);
        if slope <= 0.0 {
            return f64::INFINITY;
        }
        // The formula assumes rows of full weight; the system's rows have the mean weight.
        (self.squares / freedom / (slope * slope)).max(1.0) * self.weights / self.count
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::Random;
    use super::*;
    use phasmid_core::statistics::biweight;

    #[test]
    fn scale_and_inflation_of_normal_residuals_are_unbiased() {
        let mut random = Random::new(5);
        let mut residuals: Vec<f64> = (0..200_000).map(|_| 2.0 * random.normal()).collect();
        let mut inflation = Inflation::default();
        for &r in &residuals {
            inflation.add(r, 2.0);
        }
        for spread in [Spread::Wide, Spread::Narrow] {
            let mut sizes: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
            let scale = spread.scale(&mut sizes);
            assert!((scale - 2.0).abs() < 0.02, "{scale}");
        }
        // The expected factor is four times the variance, divided by an efficiency of 95 %.
        let mean_weight = residuals.iter().map(|r| biweight(r / 2.0)).sum::<f64>() / 200_000.0;
        let factor = inflation.factor(6) / mean_weight;
        assert!((factor - 4.0 / 0.95).abs() < 0.05, "{factor}");
        // With 20 % gross errors, the scale from the median hardly changes.
        for r in residuals.iter_mut().step_by(5) {
            *r = 100.0;
        }
        let mut sizes: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
        let scale = Spread::Narrow.scale(&mut sizes);
        assert!((2.0..2.7).contains(&scale), "{scale}");
    }
}
