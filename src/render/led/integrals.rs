//! Means over a time step of products of exponentials, without cancellation.
//!
//! With `a` and `b` the length of a step divided by two time constants, these means are divided
//! differences of the exponential function at 0, -a, -b and -(a + b) (Higham: "Functions of
//! Matrices", 2008, section 10.7.4). They are written as sums of positive terms, for which two
//! functions of one argument are enough. The results of `model` differ from 100-digit solutions by
//! at most four units of 2^-53 (`tests`).

/// Length below which series are used, because the closed forms lose digits.
const SERIES_BELOW: f64 = 1.0;
/// The same limit for the larger of the two lengths in [`both_gone`].
const BOTH_BELOW: f64 = 0.25;

/// Exponential decay over a step with one time constant.
#[derive(Debug, Clone, Copy)]
pub(super) struct Decay {
    /// Length of the step divided by the time constant.
    length: f64,
    /// Fraction that is left after the step, exp(-length).
    pub(super) left: f64,
    /// Fraction that has decayed in the step, 1 - exp(-length).
    pub(super) gone: f64,
}

impl Decay {
    /// Creates the decay for a step of at least 0 and a time constant above 0.
    pub(super) fn new(step: f64, constant: f64) -> Self {
        let length = step / constant;
        if length > 800.0 {
            // The remaining fraction underflows to 0.
            return Self {
                length: length.min(1e300),
                left: 0.0,
                gone: 1.0,
            };
        }
        // Corrects the rounding error of the quotient, which exp would amplify by `length`.
        let rest = (-length).mul_add(constant, step) / constant;
        Self {
            length,
            left: (-length).exp() * (1.0 - rest),
            gone: -(-length).exp_m1(),
        }
    }

    /// Returns the mean of exp(-a s) for s from 0 to 1, with a the length of the step.
    pub(super) fn mean_left(&self) -> f64 {
        match self.length {
            0.0 => 1.0,
            a => self.gone / a,
        }
    }

    /// Returns the mean of 1 - exp(-a s) for s from 0 to 1.
    pub(super) fn mean_gone(&self) -> f64 {
        let a = self.length;
        if a >= SERIES_BELOW {
            return (a - self.gone) / a;
        }
        // Series a/2! - a^2/3! + a^3/4! ...
        0.5 * a
            * (3..=20)
                .rev()
                .fold(1.0, |sum, n| 1.0 - a / f64::from(n) * sum)
    }

    /// Returns the mean of exp(-a s) - exp(-a) for s from 0 to 1.
    fn mean_above_end(&self) -> f64 {
        let a = self.length;
        if a >= SERIES_BELOW {
            return (self.gone - a * self.left) / a;
        }
        // Series exp(-a) (a/2! + a^2/3! + a^3/4! ...)
        let sum = (3..=20)
            .rev()
            .fold(1.0, |sum, n| 1.0 + a / f64::from(n) * sum);
        0.5 * a * self.left * sum
    }
}

/// Returns the mean of exp(-a s) exp(-b s) for s from 0 to 1.
pub(super) fn both_left(a: &Decay, b: &Decay) -> f64 {
    match a.length + b.length {
        0.0 => 1.0,
        length => (a.gone + a.left * b.gone) / length,
    }
}

/// Returns the mean of exp(-a s) (1 - exp(-b s)) for s from 0 to 1.
pub(super) fn left_and_gone(a: &Decay, b: &Decay) -> f64 {
    match a.length + b.length {
        0.0 => 0.0,
        length => b.length / length * (a.mean_above_end() + a.left * b.mean_gone()),
    }
}

/// Returns the mean of (1 - exp(-a s)) (1 - exp(-b s)) for s from 0 to 1.
pub(super) fn both_gone(a: &Decay, b: &Decay) -> f64 {
    let (long, short) = if a.length > b.length { (a, b) } else { (b, a) };
    if long.length >= BOTH_BELOW {
        // At least a sixth of the minuend remains, so cancellation is harmless.
        return short.mean_gone() - left_and_gone(long, short);
    }
    // Computes the sum over i, j from 1 of (-a)^i (-b)^j / (i! j! (i + j + 1)).
    let mut sum = 0.0;
    let mut of_a = 1.0;
    for i in 1..=12 {
        of_a *= -a.length / f64::from(i);
        let mut of_both = of_a;
        for j in 1..=12 {
            of_both *= -b.length / f64::from(j);
            sum += of_both / f64::from(i + j + 1);
        }
    }
    sum
}
