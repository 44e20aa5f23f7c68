//! Biweight for robust least squares.

/// Tuning constant that gives 95 % of the efficiency of least squares for normal errors.
const END: f64 = 4.685;

/// Biweight of Beaton and Tukey (Technometrics 16, 1974) for a residual in standard deviations; 0
/// for NaN.
pub(super) fn biweight(residual: f64) -> f64 {
    let rest = 1.0 - (residual / END).powi(2);
    // For a NaN, f64::max returns 0.
    rest.max(0.0).powi(2)
}

/// Robust standard deviation of normal errors, from the median of their absolute values.
pub(super) fn scale(sizes: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = sizes.to_vec();
    if sizes.is_empty() {
        return 0.0;
    }
    let middle = sizes.len() / 2;
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    *median / 0.6745
}
