//! Standard normal numbers from uniform 32-bit words, by inversion of the distribution function.
//!
//! x = sqrt(2) erfinv(2 p - 1), with Giles's single-precision erfinv ("Approximating the erfinv
//! function", GPU Computing Gems Jade, 2011). It is evaluated for the smaller of the two tail
//! probabilities of a word, and the sign is restored afterwards. Both tails therefore reach as far
//! as 32 bits allow: 6.3 sigma.

use super::elementary::ln;
use std::f32::consts::SQRT_2;

/// The sign bit of a word or an f32.
pub(super) const SIGN: u32 = 1 << 31;

/// Uniform numbers, each given by its smaller tail: the tail probability, in (0, 1/2], and the sign
/// bit of the corresponding normal number.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tails<const N: usize> {
    pub(super) probability: [f32; N],
    pub(super) sign: [u32; N],
}

impl<const N: usize> Tails<N> {
    /// Returns the smaller tails of uniform words.
    #[inline(always)]
    pub(super) fn of_words(words: &[u32; N]) -> Self {
        let mut probability = [0.0; N];
        let mut sign = [0; N];
        for i in 0..N {
            // All ones if the word is in the upper half.
            let upper = ((words[i] as i32) >> 31) as u32;
            let tail = words[i] ^ upper;
            // The cast goes through i32 because SIMD instructions convert only signed integers.
            probability[i] = (tail as i32 as f32 + 0.5) * (1.0 / 4_294_967_296.0);
            sign[i] = !words[i] & SIGN;
        }
        Self { probability, sign }
    }
}

/// Converts uniform numbers to standard normal numbers.
#[inline(always)]
pub(super) fn quantiles<const N: usize>(tails: &Tails<N>) -> [f32; N] {
    let p = &tails.probability;
    let mut w = [0.0; N];
    let mut ratio = [0.0; N];
    let mut far = 0;
    for i in 0..N {
        // The argument is 1 - (1 - 2 p)^2, computed without cancellation.
        w[i] = -ln(4.0 * p[i] * (1.0 - p[i]));
        ratio[i] = polynomial(&CENTRAL, w[i] - 2.5);
        far |= u32::from(w[i] >= CENTRAL_END);
    }
    // One number in 300 lies in the tails, so most groups contain none of them.
    if far != 0 {
        for i in 0..N {
            let tail = polynomial(&TAIL, w[i].max(0.0).sqrt() - 3.0);
            ratio[i] = if w[i] < CENTRAL_END { ratio[i] } else { tail };
        }
    }
    let mut normal = [0.0; N];
    for i in 0..N {
        let magnitude = ratio[i] * (1.0 - 2.0 * p[i]) * SQRT_2;
        normal[i] = f32::from_bits(magnitude.to_bits() ^ tails.sign[i]);
    }
    normal
}

/// Giles's polynomials for erfinv(x) / x with w = -ln(1 - x^2): in w - 2.5 up to the end of the
/// central part, and in sqrt(w) - 3 beyond. Highest power first.
const CENTRAL_END: f32 = 5.0;
const CENTRAL: [f32; 9] = [
    2.810_226_4e-8,
    3.432_739_4e-7,
    -3.523_387_7e-6,
    -4.391_506_5e-6,
    2.185_808_7e-4,
    -1.253_725e-3,
    -4.177_681_6e-3,
    0.246_640_73,
    1.501_409_4,
];
const TAIL: [f32; 9] = [
    -2.002_142_6e-4,
    1.009_505_6e-4,
    1.349_343_2e-3,
    -3.673_428_4e-3,
    5.739_507_7e-3,
    -7.622_461_3e-3,
    9.438_870_5e-3,
    1.001_674,
    2.832_976_8,
];

#[inline(always)]
fn polynomial(coefficients: &[f32; 9], at: f32) -> f32 {
    let mut value = coefficients[0];
    for c in &coefficients[1..] {
        value = value * at + c;
    }
    value
}

#[cfg(test)]
mod tests {
    use super::super::elementary::exp_negative;
    use super::*;

    /// Returns the standard normal distribution function: by the continued fraction of its tail
    /// (Abramowitz and Stegun 26.2.14) or, near zero, by its series (26.2.10).
    fn cdf(x: f64) -> f64 {
        let density = (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt();
        if x.abs() < 3.0 {
            let (mut term, mut sum) = (x, x);
            for k in 1..200 {
                term *= x * x / f64::from(2 * k + 1);
                sum += term;
            }
            return 0.5 + density * sum;
        }
        let mut fraction = 0.0;
        for k in (1..200).rev() {
            fraction = f64::from(k) / (x.abs() + fraction);
        }
        let tail = density / (x.abs() + fraction);
        if x < 0.0 { tail } else { 1.0 - tail }
    }

    /// Logarithm, exponential and normal numbers are accurate for words at both ends of the range
    /// and between.
    #[cfg(feature = "gpu")]
    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn gpu_functions_match_the_cpu_within_rounding() {
        let spread = |i: u32| i.wrapping_mul(2_654_435_769);
        let ends = (0..1000).flat_map(|i| [i, !i, (1 << 31) + i, (1 << 31) - i - 1]);
        let words: Vec<u32> = ends.chain((0..500_000).map(spread)).collect();
        let count = words.len();
        let output =
            crate::gpu::Engine::for_tests().call("tests/normal_test", &words, 3 * count, count);
        let (results, _) = output.as_chunks();
        for (&word, &[log, exp, normal]) in words.iter().zip(results) {
            let x = (word as f32 + 0.5) * (80.0 / 4_294_967_296.0);
            let [log, exp, normal] = [log, exp, normal].map(f32::from_bits);
            let [expected] = quantiles(&Tails::of_words(&[word]));
            assert!((log - ln(x)).abs() <= 5e-7 * ln(x).abs().max(1.0), "{x}");
            assert!((exp / exp_negative(x) - 1.0).abs() < 1e-6, "{x}");
            assert!((normal - expected).abs() < 4e-6, "{word}: {normal}");
        }
    }

    #[test]
    fn quantiles_invert_the_normal_distribution() {
        for i in 0..=2000u32 {
            // Raising i to a power makes the samples dense in the tail, down to the smallest word,
            // which is 0.
            let word = (f64::from(i) / 2000.0).powi(6) * 2_147_483_647.0;
            let word = word as u32;
            let p = (f64::from(word) + 0.5) / 4_294_967_296.0;
            let [low, high] = quantiles(&Tails::of_words(&[word, !word]));
            let x = f64::from(low);
            let density = (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt();
            // Error of x, derived from the error of p.
            let error = (cdf(x) - p) / density;
            // Giles fitted his polynomials up to the last f32 below 1, at 5.4 standard deviations.
            let bound = if x.abs() < 5.3 {
                3e-6 * (1.0 + x.abs())
            } else {
                3e-3
            };
            assert!(error.abs() < bound, "{word}: {x} {error:e}");
            assert_eq!(high, -low);
        }
    }
}
