//! Weights that let go of what does not fit.

/// Where the biweight ends: 95 % as good as least squares where all errors are normal.
const END: f64 = 4.685;

/// The biweight of Beaton and Tukey (Technometrics 16, 1974) of a residual in standard deviations;
/// 0 for NaN.
pub(super) fn biweight(residual: f64) -> f64 {
    let rest = 1.0 - (residual / END).powi(2);
    // f64::max drops a NaN.
    rest.max(0.0).powi(2)
}

/// Standard deviation of normal errors with these sizes, by their median.
pub(super) fn scale(sizes: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = sizes.to_vec();
    if sizes.is_empty() {
        return 0.0;
    }
    let middle = sizes.len() / 2;
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    *median / 0.6745
}
