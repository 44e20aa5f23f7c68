//! Shot and read noise.
//!
//! EMVA 1288 release 4.0, section 2: a pixel's electrons are Poisson distributed and limited to the
//! full well; the readout adds normal noise. If the mean mu is large and the full well far above mu,
//! the sum of shot and read noise is drawn as one number from its variance V, skewness g1 and excess
//! kurtosis g2 by the Cornish-Fisher expansion (1938). With the cumulants of a Poisson variable
//! within a total variance of V, g1 = mu / V^1.5 and g2 = mu / V^2:
//!
//! x = mu + sqrt(V) (z + (z^2 - 1) g1 / 6 + (z^3 - 3 z) g2 / 24 - (2 z^3 - 5 z) g1^2 / 36).

use super::normal::{Tails, quantiles};
use super::philox::BLOCK;
use super::{philox, poisson};
use phasmid_core::simd::widest;

/// Upper limit of the magnitude of the standard normal numbers that are drawn.
pub(super) const FARTHEST: f32 = 7.0;
/// Draw indices of the random numbers for shot and read noise.
const DRAW_SHOT: u32 = 0;
const DRAW_READ: u32 = 1;

/// Noise parameters of one frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Noise {
    pub(super) key: [u64; 2],
    pub(super) read_noise_e: f32,
    full_well_e: f32,
    /// Mean in electrons above which the full well may clip a pixel, so that shot and read noise are
    /// drawn separately.
    pub(super) apart_from_e: f32,
}

impl Noise {
    /// Creates the noise parameters. `key` is the seed and the noise id. `hidden` says that the
    /// converter saturates before the full well has an effect, even with noise.
    pub(super) fn new(key: [u64; 2], read_noise_e: f32, full_well_e: f32, hidden: bool) -> Self {
        // Normal numbers drawn from 32-bit words reach at most 6.4 standard deviations.
        let near = (full_well_e - FARTHEST * full_well_e.sqrt()).max(poisson::BELOW);
        Self {
            key,
            read_noise_e,
            full_well_e,
            apart_from_e: if hidden { f32::INFINITY } else { near },
        }
    }
}

/// Number of blocks of random numbers generated at a time; small, so that they stay in cache.
const BATCH: usize = 16;

/// Replaces the mean electrons of pixels that start at index `first`, a multiple of [`BLOCK`], by
/// random draws.
pub(super) fn draw(noise: &Noise, first: usize, electrons: &mut [f32]) {
    let (blocks, end) = electrons.as_chunks_mut::<BLOCK>();
    let mut index = (first / BLOCK) as u32;
    for batch in blocks.chunks_mut(BATCH) {
        draw_batch(noise, index, batch);
        index = index.wrapping_add(BATCH as u32);
    }
    if !end.is_empty() {
        let mut block = [poisson::BELOW; BLOCK];
        block[..end.len()].copy_from_slice(end);
        draw_batch(
            noise,
            (first / BLOCK + blocks.len()) as u32,
            std::array::from_mut(&mut block),
        );
        end.copy_from_slice(&block[..end.len()]);
    }
}

fn draw_batch(noise: &Noise, index: u32, blocks: &mut [[f32; BLOCK]]) {
    let mut words = [[0; BLOCK]; BATCH];
    let words = &mut words[..blocks.len()];
    philox::fill(noise.key, index, DRAW_SHOT, words);
    // Few pixels approach the full well, so most blocks need no second random number.
    let mut more = [[0; BLOCK]; BATCH];
    if blocks
        .as_flattened()
        .iter()
        .any(|&e| e >= noise.apart_from_e)
    {
        philox::fill(noise.key, index, DRAW_READ, &mut more[..blocks.len()]);
    }
    spread(noise, words, &more, blocks);
}

widest! {
    fn spread(
        noise: &Noise, words: &[[u32; BLOCK]], more: &[[u32; BLOCK]], blocks: &mut [[f32; BLOCK]],
    ) => spread_body
}

#[inline(always)]
fn spread_body(
    noise: &Noise,
    words: &[[u32; BLOCK]],
    more: &[[u32; BLOCK]],
    blocks: &mut [[f32; BLOCK]],
) {
    for ((electrons, words), more) in blocks.iter_mut().zip(words).zip(more) {
        let mean = *electrons;
        let (mut dark, mut bright, mut full) = (0, 0, 0);
        for &e in electrons.iter() {
            dark |= u32::from(e < poisson::BELOW);
            bright |= u32::from(e >= poisson::BELOW);
            full |= u32::from(e >= noise.apart_from_e);
        }
        if dark == 0 {
            even(noise, electrons, words);
        } else {
            few(noise, electrons, words, bright != 0);
        }
        if full != 0 {
            clipped(noise, &mean, electrons, words, more);
        }
    }
}

/// Draws a block of bright pixels that all stay far below the full well.
#[inline(always)]
fn even(noise: &Noise, electrons: &mut [f32; BLOCK], words: &[u32; BLOCK]) {
    let read_variance = noise.read_noise_e * noise.read_noise_e;
    let z = quantiles(&Tails::of_words(words));
    for i in 0..BLOCK {
        electrons[i] = many(electrons[i], read_variance, z[i]);
    }
}

/// Draws a block that contains dark pixels, and brighter ones as well if `bright`.
#[inline(always)]
fn few(noise: &Noise, electrons: &mut [f32; BLOCK], words: &[u32; BLOCK], bright: bool) {
    let read_variance = noise.read_noise_e * noise.read_noise_e;
    let (number, tails) = poisson::numbers(electrons, words);
    let z = quantiles(&tails);
    if bright {
        for i in 0..BLOCK {
            let many = many(electrons[i], read_variance, z[i]);
            let few = number[i] + noise.read_noise_e * z[i];
            electrons[i] = if electrons[i] < poisson::BELOW {
                few
            } else {
                many
            };
        }
    } else {
        for i in 0..BLOCK {
            electrons[i] = number[i] + noise.read_noise_e * z[i];
        }
    }
}

/// Redraws pixels whose means are near or above the full well: shot noise, clipping, read noise.
#[inline(always)]
fn clipped(
    noise: &Noise,
    mean: &[f32; BLOCK],
    electrons: &mut [f32; BLOCK],
    words: &[u32; BLOCK],
    more: &[u32; BLOCK],
) {
    let z = quantiles(&Tails::of_words(words));
    let read = quantiles(&Tails::of_words(more));
    for i in 0..BLOCK {
        let shot = many(mean[i], 0.0, z[i]);
        let kept = if shot < noise.full_well_e {
            shot
        } else {
            noise.full_well_e
        };
        let drawn = kept + noise.read_noise_e * read[i];
        electrons[i] = if mean[i] < noise.apart_from_e {
            electrons[i]
        } else {
            drawn
        };
    }
}

/// Returns the mean plus shot noise plus read noise of the given variance, from one normal number.
#[inline(always)]
fn many(mean: f32, read_variance: f32, z: f32) -> f32 {
    let variance = mean + read_variance;
    let inverse = 1.0 / variance.sqrt();
    // With this share, g1 = share * inverse and g2 = share * inverse^2.
    let share = mean * (inverse * inverse);
    let square = z * z;
    let excess = (square - 3.0) * (1.0 / 24.0) - (2.0 * square - 5.0) * (share * (1.0 / 36.0));
    mean + z * (variance * inverse) + share * ((square - 1.0) * (1.0 / 6.0) + z * excess * inverse)
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 1 << 20;

    fn drawn(mean: f32, read_noise_e: f32, key: [u64; 2]) -> Vec<f32> {
        let mut electrons = vec![mean; N];
        draw(
            &Noise::new(key, read_noise_e, 1e6, false),
            0,
            &mut electrons,
        );
        electrons
    }

    /// Returns the standard normal distribution function, accurate to 1e-12, by Simpson's rule from
    /// 0.
    fn normal(x: f64) -> f64 {
        let x = x.clamp(-9.0, 9.0);
        let steps = 400;
        let h = x / f64::from(steps);
        let density = |t: f64| (-0.5 * t * t).exp() / std::f64::consts::TAU.sqrt();
        let inner: f64 = (1..steps)
            .map(|k| density(f64::from(k) * h) * if k % 2 == 1 { 4.0 } else { 2.0 })
            .sum();
        0.5 + h / 3.0 * (density(0.0) + inner + density(x))
    }

    /// Returns the Poisson probabilities of 0, 1, 2, ...
    fn poisson(mean: f64) -> Vec<f64> {
        let mut log_p = -mean;
        (0..(mean + 12.0 * mean.sqrt() + 20.0) as u32)
            .map(|n| {
                if n > 0 {
                    log_p += (mean / f64::from(n)).ln();
                }
                log_p.exp()
            })
            .collect()
    }

    /// Returns Pearson's chi-square of `values`, and its critical value, which one run in 10,000
    /// exceeds (Wilson and Hilferty 1931). The bins are one electron wide and centred on integers;
    /// they are merged until each expects at least ten values.
    fn chi_square(values: &[f32], below: impl Fn(f64) -> f64) -> (f64, f64) {
        let least = values.iter().copied().fold(f32::MAX, f32::min).round() as i32 - 30;
        let most = values.iter().copied().fold(f32::MIN, f32::max).round() as i32 + 30;
        let mut counts = vec![0.0; (most - least + 1) as usize];
        for v in values {
            counts[(v.round() as i32 - least) as usize] += 1.0;
        }
        let n = values.len() as f64;
        let (mut statistic, mut bins) = (0.0, 0.0);
        let (mut count, mut from) = (0.0, 0.0);
        for (k, c) in counts.iter().enumerate() {
            count += c;
            let to = below(f64::from(least) + k as f64 + 0.5);
            // The last bin also includes the tail.
            let to = if n * (1.0 - to) < 10.0 { 1.0 } else { to };
            let expected = n * (to - from);
            if expected >= 10.0 || to == 1.0 {
                if to == 1.0 {
                    count += counts[k + 1..].iter().sum::<f64>();
                }
                statistic += (count - expected).powi(2) / expected;
                bins += 1.0;
                (count, from) = (0.0, to);
                if to == 1.0 {
                    break;
                }
            }
        }
        let free: f64 = bins - 1.0;
        let critical = if free < 1.0 {
            0.0
        } else {
            free * (1.0 - 2.0 / (9.0 * free) + 3.719 * (2.0 / (9.0 * free)).sqrt()).powi(3)
        };
        (statistic, critical)
    }

    /// Draws a million values per mean, for means on both sides of the switch from Poisson to normal
    /// numbers. A correct sampler fails for one seed in 10,000; the seeds are fixed.
    #[test]
    fn shot_noise_is_poisson_distributed() {
        for (i, mean) in [0.01, 0.4, 1.0, 5.0, 12.3, 31.9, 32.0, 33.0, 100.0, 2000.0]
            .into_iter()
            .enumerate()
        {
            let p = poisson(f64::from(mean));
            let mut sums = p.clone();
            for n in 1..sums.len() {
                sums[n] += sums[n - 1];
            }
            let below = |x: f64| match x {
                x if x < 0.0 => 0.0,
                x => sums[(x as usize).min(sums.len() - 1)],
            };
            let (statistic, critical) = chi_square(&drawn(mean, 0.0, [11, i as u64]), below);
            assert!(
                statistic < critical,
                "mean {mean}: {statistic} > {critical}"
            );
        }
    }

    /// Repeats the test with read noise, which is drawn from the same random word as the pixel's
    /// shot noise. The sum is distributed as a mixture of normal distributions weighted by the
    /// Poisson probabilities. At a read noise of 0.3 electrons, values are scaled by ten, so that
    /// the bins, which are one electron wide, resolve the peaks at whole electrons.
    #[test]
    fn read_noise_is_normal_and_independent() {
        for (i, (mean, read, zoom)) in [
            (0.0, 2.3, 10.0),
            (0.7, 0.3, 10.0),
            (6.0, 0.3, 10.0),
            (1.5, 2.3, 4.0),
            (31.0, 1.0, 4.0),
            (33.0, 2.3, 1.0),
            (400.0, 9.0, 1.0),
        ]
        .into_iter()
        .enumerate()
        {
            let p = poisson(f64::from(mean));
            let below = |x: f64| -> f64 {
                let x = x / f64::from(zoom);
                p.iter()
                    .enumerate()
                    .filter(|(_, p)| **p > 1e-13)
                    .map(|(n, p)| p * normal((x - n as f64) / f64::from(read)))
                    .sum()
            };
            let values: Vec<f32> = drawn(mean, read, [12, i as u64])
                .iter()
                .map(|e| e * zoom)
                .collect();
            let (statistic, critical) = chi_square(&values, below);
            assert!(
                statistic < critical,
                "{mean} {read}: {statistic} > {critical}"
            );
        }
    }

    /// The test rejects a wrong distribution: a normal distribution with equal mean and variance.
    #[test]
    fn chi_square_test_rejects_a_normal_distribution() {
        let below = |x: f64| normal((x - 12.3) / 12.3f64.sqrt());
        let (statistic, critical) = chi_square(&drawn(12.3, 0.0, [13, 0]), below);
        assert!(statistic > 10.0 * critical, "{statistic} {critical}");
    }

    /// The results are bit-identical: on a machine with AVX2, the AVX2 code is compared with the
    /// code for any x86-64 machine.
    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let noise = Noise::new([7, 1], 2.3, 600.0, false);
        let mut words = vec![[0; BLOCK]; 256];
        philox::fill([7, 1], 64, DRAW_SHOT, &mut words);
        let mut wide = vec![[0.0; BLOCK]; 256];
        for (i, e) in wide.as_flattened_mut().iter_mut().enumerate() {
            *e = (i % 1000) as f32 * 0.7;
        }
        let mut narrow = wide.clone();
        spread(&noise, &words, &words, &mut wide);
        spread_body(&noise, &words, &words, &mut narrow);
        let bits = |e: &[[f32; BLOCK]]| {
            let flat = e.as_flattened().iter();
            flat.map(|e| e.to_bits()).collect::<Vec<_>>()
        };
        assert_eq!(bits(&wide), bits(&narrow));
    }

    /// A pixel's draw depends only on its own mean and position, not on its neighbours.
    #[test]
    fn draw_depends_only_on_pixel_mean_and_position() {
        let noise = Noise::new([3, 9], 2.3, 600.0, false);
        let mean = |i: usize| [5.0, 40.0, 100.0, 31.0, 900.0, 590.0, 0.0][i * 7919 % 7];
        let mut all: Vec<f32> = (0..1000).map(mean).collect();
        draw(&noise, 0, &mut all);
        let mut cut: Vec<f32> = (0..77).map(|i| mean(96 + i)).collect();
        draw(&noise, 96, &mut cut);
        assert_eq!(cut, all[96..96 + 77]);
        for i in (0..1000).step_by(13) {
            let mut alone = vec![mean(i); 1000];
            draw(&noise, 0, &mut alone);
            assert_eq!(alone[i], all[i], "{}", mean(i));
        }
    }

    /// The full well clips shot noise but not read noise.
    #[test]
    fn a_full_well_has_read_noise_alone() {
        let noise = Noise::new([3, 9], 2.0, 1000.0, false);
        let mut electrons = vec![5000.0; N];
        draw(&noise, 0, &mut electrons);
        let n = N as f64;
        let mean = electrons.iter().map(|&e| f64::from(e)).sum::<f64>() / n;
        let variance = electrons
            .iter()
            .map(|&e| (f64::from(e) - mean).powi(2))
            .sum::<f64>()
            / n;
        // Five standard errors.
        assert!((mean - 1000.0).abs() < 5.0 * 2.0 / n.sqrt(), "{mean}");
        assert!(
            (variance / 4.0 - 1.0).abs() < 5.0 * (2.0 / n).sqrt(),
            "{variance}"
        );
    }

    /// The output contains no NaN, whatever the input.
    #[test]
    fn any_mean_gives_finite_electrons() {
        for read in [0.0, 2.0] {
            let noise = Noise::new([1, u64::MAX], read, 1e4, false);
            let mut electrons: Vec<f32> = [0.0, 1e-38, 1e-9, 31.999_998, 32.0, 1e9, 1e30]
                .into_iter()
                .cycle()
                .take(1001)
                .collect();
            draw(&noise, 0, &mut electrons);
            assert!(electrons.iter().all(|e| e.is_finite() && e.abs() < 2e4));
        }
    }
}
