//! Resolution limit of fringes.

use std::f64::consts::PI;

/// Minimum remaining contrast of a resolved fringe.
const LEAST: f64 = 0.05;

/// Returns whether a fringe of `period` projector pixels is resolved under a footprint with
/// derivatives `slope` and a blur of standard deviation `sigma` (projector pixels), where skin
/// leaves the fraction `under` of its contrast.
///
/// The two boxes of the footprint attenuate the contrast by sinc(a/P) sinc(b/P), which is 0 for a
/// box of one period and negative beyond; the Gaussian by exp(-2 pi^2 sigma^2 / P^2).
pub(crate) fn is_resolved(slope: [f32; 2], sigma: f32, under: f64, period: f64) -> bool {
    let [a, b] = slope.map(|s| f64::from(s.abs()) / period);
    let sigma = f64::from(sigma) / period;
    let sinc = |w: f64| {
        if w > 0.0 {
            (PI * w).sin() / (PI * w)
        } else {
            1.0
        }
    };
    let left = under * sinc(a) * sinc(b) * (-2.0 * (PI * sigma).powi(2)).exp();
    a < 1.0 && b < 1.0 && left >= LEAST
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fringes_down_to_one_period_a_pixel_are_resolved() {
        assert!(is_resolved([4.35, 0.0], 0.0, 1.0, 16.0));
        assert!(is_resolved([-7.6, 0.0], 0.0, 1.0, 16.0), "2.1 px a period");
        assert!(
            !is_resolved([16.0, 0.0], 0.0, 1.0, 16.0) && !is_resolved([0.0, 22.9], 0.0, 1.0, 16.0)
        );
        assert!(
            !is_resolved([0.0, 40.0], 0.0, 1.0, 16.0),
            "contrast is back, upright"
        );
        // exp(-2 pi^2 (6.24/16)^2) = 0.0497.
        assert!(
            is_resolved([0.1, 0.0], 6.2, 1.0, 16.0) && !is_resolved([0.1, 0.0], 6.24, 1.0, 16.0)
        );
        assert!(is_resolved([0.1, 0.0], 0.0, 0.051, 16.0));
        assert!(!is_resolved([0.1, 0.0], 0.0, 0.049, 16.0));
        assert!(!is_resolved([f32::NAN, 0.0], 0.0, 1.0, 16.0));
    }
}
