//! Poisson numbers with small means, vectorized, by inversion of the distribution.
//!
//! Devroye, "Non-Uniform Random Variate Generation" (1986), X.3.3: starting at 0, the probability of
//! n is the probability of n - 1 times mean / n. The result is the n at which the sum of these
//! probabilities exceeds a uniform number. The position of the uniform number within this last step
//! is again uniform and is independent of n. The read noise is drawn from this position, so that
//! dark pixels also need only one random word.

use super::elementary::exp_negative;
use super::normal::{SIGN, Tails};
use super::philox::BLOCK;

/// Minimum mean that [`super::noise`] draws from a normal number; smaller means are drawn here.
pub(super) const BELOW: f32 = 32.0;
/// Probabilities are in units of 2^-24, in which the upper bits of a word are exact f32 integers.
const ONE: f32 = (1u32 << 24) as f32;
/// Maximum number of steps; at the largest mean, larger numbers have a probability of 1e-13.
const STEPS: usize = 84;
/// Number of steps between checks whether all lanes are done.
const STRIDE: usize = 4;

/// Values of 1 / (n + 1) for each n.
const INVERSE_OF_NEXT: [f32; STEPS] = {
    let mut inverse = [0.0; STEPS];
    let mut n = 0;
    while n < STEPS {
        inverse[n] = 1.0 / (n + 1) as f32;
        n += 1;
    }
    inverse
};

/// Returns Poisson numbers with the means `means` (0 or more) and, from the same words, independent
/// uniform numbers. Lanes with a mean of [`BELOW`] or more are skipped; the uniform number of such a
/// lane is its whole word.
#[inline(always)]
pub(super) fn numbers(means: &[f32; BLOCK], words: &[u32; BLOCK]) -> ([f32; BLOCK], Tails<BLOCK>) {
    let mut mean = [0.0; BLOCK];
    let mut probability = [0.0; BLOCK];
    // The uniform number minus the sum of the probabilities so far: positive at first, negative in
    // the end.
    let mut left = [0.0; BLOCK];
    // The smallest positive and the smallest negative of the values of `left` so far, by magnitude,
    // as f32 bits. Compared as unsigned integers, positive values come first; compared as signed
    // integers, negative values come first. Both orders rise with the magnitude.
    let mut low = [0u32; BLOCK];
    let mut high = [i32::MAX; BLOCK];
    // Minus the number of negative values of `left` so far.
    let mut past = [0i32; BLOCK];
    for i in 0..BLOCK {
        let few = means[i] < BELOW;
        mean[i] = if few { means[i] } else { 0.0 };
        left[i] = if few {
            (words[i] >> 8) as i32 as f32
        } else {
            -1.0
        };
        low[i] = left[i].to_bits();
        probability[i] = exp_negative(mean[i]) * ONE;
    }
    let mut n = 0;
    let mut going = 1;
    while going != 0 && n < STEPS {
        for inverse in &INVERSE_OF_NEXT[n..n + STRIDE] {
            for i in 0..BLOCK {
                left[i] -= probability[i];
                probability[i] *= mean[i] * inverse;
                let bits = left[i].to_bits();
                low[i] = low[i].min(bits);
                high[i] = high[i].min(bits as i32);
                past[i] += bits as i32 >> 31;
            }
        }
        n += STRIDE;
        going = 0;
        for i in 0..BLOCK {
            going |= u32::from(left[i] >= 0.0);
        }
    }
    let mut tails = Tails::of_words(words);
    let mut number = [0.0; BLOCK];
    for i in 0..BLOCK {
        let few = means[i] < BELOW;
        number[i] = (n as i32 + past[i]) as f32;
        let low = f32::from_bits(low[i]);
        let high = -f32::from_bits(high[i] as u32);
        let tail = if low + 0.5 < high { low + 0.5 } else { high };
        let side = if low + 0.5 < high { SIGN } else { 0 };
        let tail = tail / (low + high);
        // In a step narrower than one unit, adding half a unit would exceed the step.
        let tail = if tail < 0.5 { tail } else { 0.5 };
        tails.probability[i] = if few { tail } else { tails.probability[i] };
        tails.sign[i] = if few { side } else { tails.sign[i] };
    }
    if going != 0 {
        far_tail(&left, &mean, words, &mut number, &mut tails.probability);
    }
    (number, tails)
}

/// Resolves lanes in the far tail. Because of rounding, the f32 sums end about 1e-7 below one. If a
/// lane's uniform number lies in this gap, f64 sums give the lane's count, and the middle of the
/// count's last step replaces the uniform number.
#[cold]
fn far_tail(
    left: &[f32; BLOCK],
    mean: &[f32; BLOCK],
    words: &[u32; BLOCK],
    number: &mut [f32; BLOCK],
    probability: &mut [f32; BLOCK],
) {
    for i in 0..BLOCK {
        if left[i] >= 0.0 {
            number[i] = exactly(mean[i], words[i]);
            probability[i] = 0.5;
        }
    }
}

/// Returns the Poisson number of a word, computed from f64 sums.
fn exactly(mean: f32, word: u32) -> f32 {
    let mean = f64::from(mean);
    let uniform = (f64::from(word >> 8) + 0.5) / f64::from(ONE);
    let mut probability = (-mean).exp();
    let mut sum = probability;
    let mut n = 0.0;
    while sum < uniform && n < STEPS as f64 {
        n += 1.0;
        probability *= mean / n;
        sum += probability;
    }
    n as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers agree with f64 sums, except for words at the border between two numbers.
    #[test]
    fn numbers_invert_the_poisson_distribution() {
        let mut differ = 0;
        for k in 0..60_000u32 {
            let words: [u32; BLOCK] =
                std::array::from_fn(|i| (k * 32 + i as u32).wrapping_mul(2_654_435_769));
            let means: [f32; BLOCK] =
                std::array::from_fn(|i| ((k % 331) as f32 / 10.0 + i as f32) % 32.0);
            let (numbers, tails) = numbers(&means, &words);
            for i in 0..BLOCK {
                let exact = exactly(means[i], words[i]);
                assert!(
                    (numbers[i] - exact).abs() <= 1.0,
                    "{} of {}",
                    words[i],
                    means[i]
                );
                differ += u32::from(numbers[i] != exact);
                assert!(tails.probability[i] > 0.0 && tails.probability[i] <= 0.5);
            }
        }
        // Ten of 1.9 million words differ, each within 1e-7 of a border.
        assert!(differ <= 20, "{differ}");
    }

    /// GPU and CPU agree for any mean with any word; for words of the far tail the GPU lacks f64.
    #[cfg(feature = "gpu")]
    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn gpu_numbers_match_the_cpu() {
        let hash = |i: u32| (i ^ i >> 15).wrapping_mul(0x85eb_ca6b);
        let mean = |i: u32| match i % 5 {
            0 => 0.0,
            1 => (hash(i) as f32 / 4.3e9).powi(8) * 31.9,
            2 => 31.999_998,
            _ => hash(i) as f32 / 4.3e9 * 32.0,
        };
        let mut engine = crate::gpu::Engine::for_tests();
        for far in [false, true] {
            let word = |i: u32| {
                let word = hash(i.wrapping_mul(2_654_435_769));
                if far { word | 0xffff_c000 } else { word }
            };
            let count = 1 << 18;
            let input: Vec<u32> = (0..count)
                .flat_map(|i| [mean(i).to_bits(), word(i)])
                .collect();
            let len = count as usize;
            let output = engine.call("tests/poisson_test", &input, 4 * len, len);
            let (mut differ, mut differ_far, mut rest) = (0, 0, 0.0);
            let (lanes, _) = output.as_chunks::<4>();
            for (block, lanes) in lanes.chunks(BLOCK).enumerate() {
                let index = |i: usize| (block * BLOCK + i) as u32;
                let words = std::array::from_fn(|i| word(index(i)));
                let means = std::array::from_fn(|i| mean(index(i)));
                let (cpu, tails) = numbers(&means, &words);
                for i in 0..BLOCK {
                    let [number, probability, sign, in_far_tail] = lanes[i];
                    let number = f32::from_bits(number);
                    assert!((number - cpu[i]).abs() <= 1.0, "{} {}", means[i], words[i]);
                    differ += u32::from(number != cpu[i]);
                    if number == cpu[i] && sign == tails.sign[i] {
                        let left = f32::from_bits(probability) - tails.probability[i];
                        rest = left.abs().max(rest);
                    }
                    if words[i] >> 14 == u32::MAX >> 14 {
                        let exact = exactly(means[i], words[i]);
                        let error = (f32::from_bits(in_far_tail) - exact).abs();
                        assert!(error <= 1.0, "{} of {}", words[i], means[i]);
                        differ_far += u32::from(error > 0.0);
                    }
                }
            }
            println!(
                "far tail {far}: {differ}, {differ_far} of {count} differ, the rest by {rest:e}"
            );
            // Words at the border between two numbers may differ.
            assert!(differ_far <= 5, "{differ_far}");
            assert!(differ <= if far { 20 } else { 2 }, "{differ}");
            // Steps of the far tail are narrower than one unit, so only other words are compared.
            assert!(far || rest < 0.01, "{rest}");
        }
    }

    /// The returned uniform number is the position of the word within the step of its Poisson
    /// number.
    #[test]
    fn remaining_randomness_is_uniform() {
        let mean = 1.5;
        let step = 1 << 12;
        let words: [u32; BLOCK] = std::array::from_fn(|i| (0.3e9 as u32) + i as u32 * step);
        let (numbers, tails) = numbers(&[mean; BLOCK], &words);
        let p0 = f64::from(-mean).exp();
        for i in 0..BLOCK {
            assert_eq!(numbers[i], 0.0);
            let expected = f64::from(words[i]) / 4_294_967_296.0 / p0;
            assert!((f64::from(tails.probability[i]) - expected).abs() < 1e-6);
            assert_eq!(tails.sign[i], SIGN);
        }
    }
}
