//! Numbers, and numbers with their gradient: a formula written once over [`Real`] gives a fast
//! value or, if needed, exact derivatives (forward-mode automatic differentiation: Griewank and
//! Walther, "Evaluating Derivatives", 2008, chapter 3).

use glam::DVec3;
use std::ops::{Add, Mul, Neg, Sub};

/// Number type of the phantom's formulas.
pub(super) trait Real:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
{
    /// Returns the value.
    fn value(self) -> f64;

    /// Applies a function, given its value and slope at this number.
    fn chain(self, value: f64, slope: f64) -> Self;

    /// Returns a number that does not depend on the position.
    fn constant(self, value: f64) -> Self {
        self.chain(value, 0.0)
    }

    /// Returns |v|^2.5, the exponent of cross-sections between an ellipse and a rectangle: twice
    /// continuously differentiable, and computed with only a square root.
    fn abs_pow_5_2(self) -> Self {
        let v = self.value();
        let root = v.abs().sqrt();
        self.chain(v * v * root, 2.5 * v * root)
    }

    /// v / sqrt(v^2 + 1): an odd function, linear near 0, with limits of +-1.
    fn saturated(self) -> Self {
        let v = self.value();
        let root = (v * v + 1.0).sqrt();
        self.chain(v / root, 1.0 / (root * root * root))
    }

    /// A smooth step: 0 for v <= 0, 1 for v >= 1, twice continuously differentiable (Perlin,
    /// "Improving Noise", 2002). Its slope is at most 1.875.
    fn rise(self) -> Self {
        let v = self.value().clamp(0.0, 1.0);
        let value = v * v * v * (v * (6.0 * v - 15.0) + 10.0);
        let back = v * (1.0 - v);
        self.chain(value, 30.0 * back * back)
    }
}

impl Real for f64 {
    fn value(self) -> f64 {
        self
    }

    fn chain(self, value: f64, _: f64) -> Self {
        value
    }
}

/// A number and its derivatives by x, y and z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Jet {
    pub(super) value: f64,
    pub(super) gradient: DVec3,
}

impl Jet {
    /// Returns the coordinates of a point as jets.
    pub(super) fn place(x: DVec3) -> [Self; 3] {
        DVec3::AXES.map(|axis| Self {
            value: x.dot(axis),
            gradient: axis,
        })
    }
}

impl Real for Jet {
    fn value(self) -> f64 {
        self.value
    }

    fn chain(self, value: f64, slope: f64) -> Self {
        Self {
            value,
            gradient: self.gradient * slope,
        }
    }
}

impl Add for Jet {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            gradient: self.gradient + other.gradient,
        }
    }
}

impl Sub for Jet {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Jet {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            gradient: self.gradient * other.value + other.gradient * self.value,
        }
    }
}

impl Neg for Jet {
    type Output = Self;
    fn neg(self) -> Self {
        self * -1.0
    }
}

impl Add<f64> for Jet {
    type Output = Self;
    fn add(self, other: f64) -> Self {
        self.chain(self.value + other, 1.0)
    }
}

impl Sub<f64> for Jet {
    type Output = Self;
    fn sub(self, other: f64) -> Self {
        self + -other
    }
}

impl Mul<f64> for Jet {
    type Output = Self;
    fn mul(self, other: f64) -> Self {
        self.chain(self.value * other, other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn formula<T: Real>([x, y, z]: [T; 3]) -> T {
        let bent = (x * 0.3 - y * z).abs_pow_5_2() + (y * 0.7 + 0.2).rise() * z;
        (bent - x * y * 2.0).saturated() - -z * 0.25
    }

    #[test]
    fn gradient_matches_finite_differences() {
        for place in [
            DVec3::new(0.4, 0.3, -0.9),
            DVec3::new(-1.2, 0.8, 0.5),
            DVec3::new(0.0, 0.0, 0.0),
        ] {
            let jet = formula(Jet::place(place));
            assert!((jet.value - formula(place.to_array())).abs() < 1e-15);
            let step = 1e-6;
            let differences = DVec3::from_array(DVec3::AXES.map(|axis| {
                let at = |side: f64| formula((place + side * step * axis).to_array());
                (at(1.0) - at(-1.0)) / (2.0 * step)
            }));
            let off = (jet.gradient - differences).length();
            assert!(off < 1e-8, "{place}: {off}");
        }
    }

    #[test]
    fn smooth_step_rises_from_zero_to_one() {
        assert_eq!((-0.1).rise(), 0.0);
        assert_eq!(1.5.rise(), 1.0);
        assert_eq!(0.5.rise(), 0.5);
        let [x, ..] = Jet::place(DVec3::splat(0.5));
        assert!((x.rise().gradient.x - 1.875).abs() < 1e-15);
    }
}
