//! Branch-free f32 logarithm and exponential without library calls: vectorizable over lanes, and
//! bit-identical on every machine.

use std::f32::consts::{LN_2, LOG2_E};

/// Returns the natural logarithm of a normal positive number, with a relative or absolute error of
/// at most 2e-7. Splits off the exponent and evaluates a polynomial in s = (m - 1)/(m + 1): ln m = 2
/// (s + s^3/3 + s^5/5 + ...), for a mantissa m in [1/sqrt 2, sqrt 2).
#[inline(always)]
pub(super) fn ln(x: f32) -> f32 {
    // Moves the lower limit of the mantissa's range to 1/sqrt(2).
    let bits = x.to_bits().wrapping_sub(0x3f35_04f3);
    let exponent = (bits as i32) >> 23;
    let m = f32::from_bits((bits & 0x007f_ffff).wrapping_add(0x3f35_04f3));
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let series = 1.0 / 3.0 + z * (1.0 / 5.0 + z * (1.0 / 7.0 + z * (1.0 / 9.0)));
    exponent as f32 * LN_2 + 2.0 * (s + s * z * series)
}

/// Returns exp(-x) for x from 0 to 80, with a relative error of at most 4e-7. It is 2^k times the
/// exponential series of the remainder, which is within half an octave of 0.
#[inline(always)]
pub(super) fn exp_negative(x: f32) -> f32 {
    /// Adding this number to an argument leaves the nearest integer, of either sign, in the low
    /// bits.
    const WHOLE: f32 = (3u32 << 22) as f32;
    let shifted = x * -LOG2_E + WHOLE;
    let whole = shifted - WHOLE;
    // ln 2 is split into two numbers. The first number ends in zero bits, so that its product is
    // exact (Cody and Waite 1980).
    let rest = (-x - whole * 0.693_359_4) + whole * 2.121_944_4e-4;
    let mut series = 1.0 + rest * (1.0 / 7.0);
    for k in [6.0, 5.0, 4.0, 3.0, 2.0, 1.0f32] {
        series = 1.0 + series * rest * (1.0 / k);
    }
    let exponent = shifted.to_bits().wrapping_add(127) << 23;
    series * f32::from_bits(exponent)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithm_agrees_with_f64() {
        for i in 1..200_000u32 {
            let x = (f64::from(i) / 200_000.0).powi(5) as f32;
            let exact = f64::from(x).ln();
            let error = (f64::from(ln(x)) - exact).abs() / exact.abs().max(1.0);
            assert!(error < 2.5e-7, "{x}: {error:e}");
        }
    }

    #[test]
    fn exponential_agrees_with_f64() {
        for i in 0..=800_000u32 {
            let x = i as f32 * 1e-4;
            let exact = (-f64::from(x)).exp();
            let error = (f64::from(exp_negative(x)) / exact - 1.0).abs();
            assert!(error < 4e-7, "{x}: {error:e}");
        }
    }
}
