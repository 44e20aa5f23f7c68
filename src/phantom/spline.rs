//! Uniform cubic B-splines: outlines along the body, and smooth random functions of time.
//!
//! The value is a convex combination of the coefficients, and the slope is a convex combination of their
//! differences divided by the step (de Boor, "A Practical Guide to Splines", 1978, chapters IX and X).
//! Bounds of coefficients and differences therefore bound value and slope everywhere.

use super::random::Draws;
use super::real::Real;

/// A twice continuously differentiable function over evenly spaced coefficients, constant beyond
/// both ends.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Spline {
    first: f64,
    step: f64,
    coefficients: Vec<f64>,
}

impl Spline {
    /// Creates a spline from the position of the first coefficient, the step and one or more
    /// coefficients.
    pub(super) fn new(first: f64, step: f64, coefficients: Vec<f64>) -> Self {
        Self {
            first,
            step,
            coefficients,
        }
    }

    /// Returns the value at a position.
    pub(super) fn at<T: Real>(&self, place: T) -> T {
        let last = self.coefficients.len() as f64;
        let at = ((place.value() - self.first) / self.step).clamp(-1.0, last);
        let whole = at.floor();
        let ends = self.coefficients.len() as isize - 1;
        let near = [-1, 0, 1, 2].map(|i| {
            let index = (whole as isize + i).clamp(0, ends);
            self.coefficients[index as usize]
        });
        let (value, slope) = blend(near, at - whole);
        place.chain(value, slope / self.step)
    }
}

/// Value and slope between the middle two of four coefficients, at `share` (0 to 1) of the way.
fn blend(c: [f64; 4], share: f64) -> (f64, f64) {
    let (u, v) = (share, 1.0 - share);
    let value = [
        v * v * v,
        4.0 - 3.0 * u * u * (2.0 - u),
        4.0 - 3.0 * v * v * (2.0 - v),
        u * u * u,
    ];
    let differences = [c[1] - c[0], c[2] - c[1], c[3] - c[2]];
    let slope = [v * v, 1.0 + 2.0 * u * v, u * u];
    (
        (0..4).map(|i| c[i] * value[i]).sum::<f64>() / 6.0,
        (0..3).map(|i| differences[i] * slope[i]).sum::<f64>() / 2.0,
    )
}

/// Ratio of the standard deviation of [`wander`] at integers to that of its coefficients.
const AT_KNOTS: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Ratio of the standard deviation of differences of [`wander`] between adjacent integers to that of its
/// coefficients.
const BETWEEN_KNOTS: f64 = 0.745_355_992_499_929_9;

/// A random function over unlimited time, which can be evaluated at any time independently. Its
/// coefficients at the integers are uniform between -1 and 1 times `most`. Returns value and slope,
/// whose magnitudes never exceed `most` and twice `most`.
pub(super) fn wander(draws: Draws, time: f64, most: f64) -> (f64, f64) {
    let whole = time.floor();
    let coefficient = |i: i64| most * draws.even((whole as i64).wrapping_add(i));
    blend([-1, 0, 1, 2].map(coefficient), time - whole)
}

/// Returns the bound `most` for which [`wander`] has the given standard deviation at integers.
pub(super) fn most_of(deviation: f64) -> f64 {
    3f64.sqrt() * deviation / AT_KNOTS
}

/// Returns the bound `most` for which differences of [`wander`] between adjacent integers have the
/// given standard deviation.
pub(super) fn most_of_differences(deviation: f64) -> f64 {
    3f64.sqrt() * deviation / BETWEEN_KNOTS
}

#[cfg(test)]
mod tests {
    use super::super::real::Jet;
    use super::*;
    use glam::DVec3;

    #[test]
    fn a_line_stays_a_line_and_ends_are_held() {
        let line = Spline::new(
            -3.0,
            0.5,
            (0..20).map(|i| 2.0 * f64::from(i) - 1.0).collect(),
        );
        for i in 0..100 {
            let place = -2.5 + 8.0 * f64::from(i) / 100.0;
            let [x, ..] = Jet::place(DVec3::X * place);
            let got = line.at(x);
            assert!((got.value - (4.0 * (place + 3.0) - 1.0)).abs() < 1e-12);
            assert!((got.gradient.x - 4.0).abs() < 1e-12);
        }
        assert_eq!(line.at(-1e9), -1.0);
        assert_eq!(line.at(1e9), 37.0);
        let [x, ..] = Jet::place(DVec3::X * 1e9);
        assert_eq!(line.at(x).gradient, DVec3::ZERO);
    }

    #[test]
    fn wander_has_its_stated_deviations_and_is_smooth() {
        let draws = Draws::new(5, 1);
        let count = 40_000;
        let at = |i: i64| wander(draws, i as f64, 1.0).0;
        let values: Vec<f64> = (0..count).map(at).collect();
        let rms = |v: &mut dyn Iterator<Item = f64>| {
            (v.map(|v| v * v).sum::<f64>() / count as f64).sqrt()
        };
        let whole = rms(&mut values.iter().copied()) * most_of(1.0);
        assert!((whole - 1.0).abs() < 0.02, "{whole}");
        let between = rms(&mut values.windows(2).map(|p| p[1] - p[0])) * most_of_differences(1.0);
        assert!((between - 1.0).abs() < 0.02, "{between}");
        for i in 0..3000 {
            let t = f64::from(i) * 0.0137 - 20.0;
            let (value, slope) = wander(draws, t, 1.0);
            assert!(value.abs() <= 1.0 && slope.abs() <= 2.0);
            let step = 1e-6;
            let difference =
                (wander(draws, t + step, 1.0).0 - wander(draws, t - step, 1.0).0) / (2.0 * step);
            assert!(
                (slope - difference).abs() < 1e-6,
                "{t}: {slope} {difference}"
            );
        }
    }
}
