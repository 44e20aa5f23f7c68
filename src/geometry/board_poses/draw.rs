//! Low-discrepancy sequence from which board poses are drawn.

/// Numbers per pose: column and row aimed at, direction and size of the tilt, distance, roll.
pub(super) const NUMBERS: usize = 6;

/// Returns pose `index` of a sequence, each number in [0, 1). This is the additive recurrence whose
/// steps are the powers of 1 / phi, where phi is the root of x^7 = x + 1 (Roberts, "The
/// unreasonable effectiveness of quasirandom sequences", 2018). The seed determines its start.
pub(super) fn numbers(seed: u64, index: usize) -> [f64; NUMBERS] {
    let mut phi = 1.5_f64;
    for _ in 0..50 {
        phi = (1.0 + phi).powf(1.0 / (NUMBERS as f64 + 1.0));
    }
    std::array::from_fn(|i| {
        let start = shift(seed, i as u64);
        (start + (index as f64 + 1.0) * phi.powi(-(i as i32 + 1))).fract()
    })
}

/// Pseudorandom number in [0, 1) from a seed: SplitMix64 (Steele, Lea, Flood, "Fast splittable
/// pseudorandom number generators", OOPSLA 2014).
fn shift(seed: u64, number: u64) -> f64 {
    let step = 0x9e37_79b9_7f4a_7c15_u64;
    let mut z = seed
        .wrapping_add(number.wrapping_mul(step.rotate_left(17)))
        .wrapping_add(step);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^= z >> 31;
    // Keep 53 bits, the precision of f64.
    (z >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_numbers_are_spread_and_many_are_uniform() {
        for seed in 0..20 {
            let drawn: Vec<_> = (0..20).map(|i| numbers(seed, i)).collect();
            for number in 0..NUMBERS {
                let quarter = |q: f64| {
                    let inside = |d: &&[f64; NUMBERS]| (q..q + 0.25).contains(&d[number]);
                    drawn.iter().filter(inside).count()
                };
                let counts = [0.0, 0.25, 0.5, 0.75].map(quarter);
                assert_eq!(counts.iter().sum::<usize>(), 20);
                assert!(counts.iter().all(|c| (2..=8).contains(c)), "{counts:?}");
            }
        }
        let mean = (0..10_000).map(|i| numbers(3, i)[5]).sum::<f64>() / 10_000.0;
        assert!((mean - 0.5).abs() < 1e-2, "{mean}");
        assert_ne!(numbers(1, 0), numbers(2, 0));
        assert_eq!(numbers(1, 7), numbers(1, 7));
    }
}
