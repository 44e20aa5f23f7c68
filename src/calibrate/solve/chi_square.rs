//! The chi-square distribution, for testing whether a covariance is right.

/// Returns the probability that a chi-square variable of `dof` degrees of freedom is below `x`.
///
/// This is the regularised incomplete gamma function P(dof/2, x/2), computed from its series
/// (Abramowitz and Stegun, "Handbook of Mathematical Functions", 6.5.29) or its continued fraction
/// (6.5.31), accurate to 1e-10. Returns NaN for NaN.
pub fn chi_square_below(x: f64, dof: usize) -> f64 {
    if dof == 0 {
        return if x.is_nan() { x } else { 1.0 };
    }
    let (a, x) = (dof as f64 / 2.0, x / 2.0);
    if !(x > 0.0) {
        return if x.is_nan() { x } else { 0.0 };
    }
    if x.is_infinite() {
        return 1.0;
    }
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    // The number of terms grows with the width of the distribution, that is, with sqrt(a).
    let most = 200 + 20 * a.sqrt() as usize;
    if x < a + 1.0 {
        let (mut term, mut sum) = (1.0 / a, 1.0 / a);
        for n in 1..most {
            term *= x / (a + n as f64);
            sum += term;
            if term < 1e-16 * sum {
                break;
            }
        }
        return (front * sum).min(1.0);
    }
    // Evaluate the fraction from its end: x + 1 - a - 1 (1 - a) / (x + 3 - a - ...).
    let mut tail = 0.0;
    for n in (1..most).rev() {
        let n = n as f64;
        tail = n * (n - a) / (x + 2.0 * n + 1.0 - a - tail);
    }
    (1.0 - front / (x + 1.0 - a - tail)).clamp(0.0, 1.0)
}

/// Returns the value below which a chi-square variable of `dof` degrees of freedom lies with the
/// given probability, by bisection of [`chi_square_below`]. Returns NaN for a probability outside
/// [0, 1).
pub fn chi_square_bound(probability: f64, dof: usize) -> f64 {
    if !(0.0..1.0).contains(&probability) {
        return f64::NAN;
    }
    let mut high = dof as f64 + 1.0;
    while chi_square_below(high, dof) < probability {
        high *= 2.0;
    }
    let mut low = 0.0;
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if chi_square_below(middle, dof) < probability {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Logarithm of the gamma function of a positive number: the recurrence raises the argument above
/// 10, then Stirling's series (Abramowitz and Stegun, 6.1.41) applies.
fn ln_gamma(mut x: f64) -> f64 {
    let mut below = 0.0;
    while x < 10.0 {
        below += x.ln();
        x += 1.0;
    }
    let s = 1.0 / (x * x);
    let series = (1.0 / 12.0 - s * (1.0 / 360.0 - s * (1.0 / 1260.0 - s / 1680.0))) / x;
    (x - 0.5) * x.ln() - x + 0.5 * std::f64::consts::TAU.ln() + series - below
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distribution_matches_closed_forms_and_tables() {
        for x in [1e-3, 0.3, 1.0, 4.0, 30.0] {
            // Two degrees of freedom: exponential distribution. Four: 1 - (1 + x/2) exp(-x/2).
            assert!((chi_square_below(x, 2) - (1.0 - (-x / 2.0).exp())).abs() < 1e-10);
            let four = 1.0 - (1.0 + x / 2.0) * (-x / 2.0).exp();
            assert!((chi_square_below(x, 4) - four).abs() < 1e-10);
        }
        // Abramowitz and Stegun, table 26.8: the 1 % points.
        for (dof, bound) in [(1, 6.63490), (10, 23.2093), (30, 50.8922), (100, 135.807)] {
            assert!((chi_square_bound(0.99, dof) - bound).abs() < 1e-3, "{dof}");
        }
        // With many degrees of freedom the median lies 2/3 below the mean.
        assert!((chi_square_bound(0.5, 10_000) - (10_000.0 - 2.0 / 3.0)).abs() < 1e-2);
        assert!(chi_square_below(f64::NAN, 3).is_nan() && chi_square_bound(1.0, 3).is_nan());
    }
}
