//! The sensor pass: mean electrons to digital numbers, by the linear model of EMVA 1288 release
//! 4.0 (section 2): shot noise, read noise, full well, system gain, black level, converter.

use super::{normal, philox};
use crate::profile::Sensor as Parameters;
use crate::protocol::PixelFormat;
use crate::simd::widest;

/// Below this mean, a pixel's electrons are drawn from the Poisson distribution itself; above, a
/// normal number with its variance and skewness is indistinguishable.
const POISSON_BELOW: f32 = 32.0;
/// Draw indices of the random terms.
const DRAW_NORMAL: u32 = 0;
const DRAW_POISSON: u32 = 1;

/// The sensor at one gain, for one frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sensor {
    full_well_e: f32,
    read_variance_e2: f32,
    gain_dn_per_e: f32,
    black_dn: f32,
    full_scale_dn: f32,
    /// Words of two bytes.
    wide: bool,
    /// Seed and frame id, or no noise at all.
    noise: Option<(u64, u64)>,
}

impl Sensor {
    pub(super) fn new(sensor: &Parameters, gain_db: f64, noise: Option<(u64, u64)>) -> Self {
        Self {
            full_well_e: sensor.full_well_e as f32,
            read_variance_e2: sensor.read_noise_e.powi(2) as f32,
            gain_dn_per_e: sensor.gain_at(gain_db) as f32,
            black_dn: sensor.black_level_dn as f32,
            full_scale_dn: sensor.full_scale_dn() as f32,
            wide: sensor.native_format() == PixelFormat::Y16,
            noise,
        }
    }

    /// Digital numbers of the pixels from `first` on, a multiple of [`philox::BLOCK`]. `electrons`
    /// holds their means and is used as scratch.
    pub(super) fn run(&self, first: usize, electrons: &mut [f32], out: &mut [u8]) {
        if let Some((seed, frame)) = self.noise {
            expose(self, [seed, frame], first, electrons);
        }
        if self.wide {
            for (e, pair) in electrons.iter().zip(out.chunks_exact_mut(2)) {
                pair.copy_from_slice(&(self.convert(*e) as i32 as u16).to_le_bytes());
            }
        } else {
            quantise_grey(self, electrons, out);
        }
    }

    /// Noise-free signal in digital numbers, not rounded, of a mean number of electrons.
    pub(super) fn signal_dn(&self, electrons: f32) -> f32 {
        let e = electrons.min(self.full_well_e);
        (e * self.gain_dn_per_e + self.black_dn).min(self.full_scale_dn)
    }

    /// Full well, gain, black level, and rounding to the converter's range.
    #[inline(always)]
    fn convert(&self, electrons: f32) -> f32 {
        let e = if electrons < self.full_well_e {
            electrons
        } else {
            self.full_well_e
        };
        let dn = e * self.gain_dn_per_e + self.black_dn;
        let dn = if dn > 0.0 { dn } else { 0.0 };
        let dn = if dn < self.full_scale_dn {
            dn
        } else {
            self.full_scale_dn
        };
        // Half a step up and truncation: rounding, as dn is not negative.
        dn + 0.5
    }
}

widest! {
    fn expose(sensor: &Sensor, key: [u64; 2], first: usize, electrons: &mut [f32]) => expose_body
}
widest! {
    fn quantise_grey(sensor: &Sensor, electrons: &[f32], out: &mut [u8]) => quantise_grey_body
}

#[inline(always)]
fn quantise_grey_body(sensor: &Sensor, electrons: &[f32], out: &mut [u8]) {
    for (byte, &e) in out.iter_mut().zip(electrons) {
        *byte = sensor.convert(e) as i32 as u8;
    }
}

/// Adds shot and read noise: one normal number with the variance V of both and, by the first term
/// of Cornish and Fisher (1938), the skewness of the shot noise: z + (z^2 - 1) g / 6, g = mu / V^1.5.
#[inline(always)]
fn expose_body(sensor: &Sensor, [seed, frame]: [u64; 2], first: usize, electrons: &mut [f32]) {
    for (k, chunk) in electrons.chunks_mut(philox::BLOCK).enumerate() {
        let index = (first / philox::BLOCK + k) as u32;
        let words = philox::block(seed, index, DRAW_NORMAL, frame);
        let z = normal::from_words(&words);
        if chunk.iter().any(|&e| e < POISSON_BELOW) {
            few_electrons(sensor, [seed, frame], index, &z, chunk);
            continue;
        }
        for (e, z) in chunk.iter_mut().zip(z) {
            *e = many_electrons(*e, sensor.read_variance_e2, z);
        }
    }
}

#[inline(always)]
fn many_electrons(mean: f32, read_variance: f32, z: f32) -> f32 {
    let variance = mean + read_variance;
    mean + z * variance.sqrt() + (z * z - 1.0) * mean / (6.0 * variance)
}

/// A block in which some pixel is dark: those draw from the Poisson distribution by inversion.
fn few_electrons(
    sensor: &Sensor,
    [seed, frame]: [u64; 2],
    index: u32,
    z: &[f32; philox::BLOCK],
    chunk: &mut [f32],
) {
    let words = philox::block(seed, index, DRAW_POISSON, frame);
    for (i, e) in chunk.iter_mut().enumerate() {
        *e = if *e < POISSON_BELOW {
            poisson(*e, words[i]) + z[i] * sensor.read_variance_e2.sqrt()
        } else {
            many_electrons(*e, sensor.read_variance_e2, z[i])
        };
    }
}

/// Poisson number of a uniform word: the smallest n whose distribution function exceeds it.
fn poisson(mean: f32, word: u32) -> f32 {
    if !(mean > 0.0) {
        return 0.0;
    }
    let mean = f64::from(mean);
    let u = (f64::from(word) + 0.5) / 4_294_967_296.0;
    let mut probability = (-mean).exp();
    let mut sum = probability;
    let mut n = 0.0;
    // 32 bits reach no further than this many standard deviations above the mean.
    let last = mean + 8.0 * mean.sqrt() + 20.0;
    while sum < u && n < last {
        n += 1.0;
        probability *= mean / n;
        sum += probability;
    }
    n as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moments(values: impl Iterator<Item = f64> + Clone) -> [f64; 3] {
        let n = values.clone().count() as f64;
        let mean = values.clone().sum::<f64>() / n;
        let central = |k| values.clone().map(|v| (v - mean).powi(k)).sum::<f64>() / n;
        [mean, central(2), central(3)]
    }

    fn sensor(read_noise: f32) -> Sensor {
        Sensor {
            full_well_e: 1e6,
            read_variance_e2: read_noise * read_noise,
            gain_dn_per_e: 1.0,
            black_dn: 0.0,
            full_scale_dn: 65535.0,
            wide: true,
            noise: Some((7, 1)),
        }
    }

    /// Mean, variance and third moment of shot noise are all the mean; read noise adds its
    /// variance. Both sides of the switch from Poisson to normal numbers.
    #[test]
    fn shot_and_read_noise_have_their_moments() {
        const N: usize = 1 << 20;
        for (mean, read_noise) in [
            (0.4, 0.0),
            (5.0, 2.0),
            (31.9, 3.0),
            (33.0, 3.0),
            (400.0, 2.3),
        ] {
            let mut electrons = vec![mean; N];
            expose(&sensor(read_noise), [7, 1], 0, &mut electrons);
            let [m1, m2, m3] = moments(electrons.iter().map(|&e| f64::from(e)));
            let (mean, variance) = (f64::from(mean), f64::from(mean + read_noise * read_noise));
            let n = N as f64;
            // Five standard errors.
            assert!(
                (m1 - mean).abs() < 5.0 * (variance / n).sqrt(),
                "{mean}: mean {m1}"
            );
            assert!(
                (m2 / variance - 1.0).abs() < 5.0 * (2.6 / n).sqrt() + 0.001,
                "{mean}: {m2}"
            );
            assert!(
                (m3 - mean).abs() < 0.06 * variance.powf(1.5) + 0.02,
                "{mean}: third {m3}"
            );
        }
    }

    /// On a machine with AVX2 this compares it with the code for any x86-64.
    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let means = |i: usize| (i % 1000) as f32 * 0.7;
        let mut wide: Vec<f32> = (0..8192).map(means).collect();
        let mut narrow = wide.clone();
        expose(&sensor(2.3), [7, 1], 64, &mut wide);
        expose_body(&sensor(2.3), [7, 1], 64, &mut narrow);
        let bits = |e: &[f32]| e.iter().map(|e| e.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&wide), bits(&narrow));
    }

    #[test]
    fn no_light_leaves_read_noise_alone() {
        let mut electrons = vec![0.0; 4096];
        expose(&sensor(0.0), [7, 1], 0, &mut electrons);
        assert!(electrons.iter().all(|&e| e == 0.0));
    }

    #[test]
    fn saturation_and_black_clip_at_the_converters_ends() {
        let sensor = Sensor {
            black_dn: 4.0,
            full_scale_dn: 255.0,
            wide: false,
            noise: None,
            ..sensor(0.0)
        };
        let mut out = [0; 4];
        sensor.run(0, &mut [-9.0, 0.0, 100.4, 1e9], &mut out);
        assert_eq!(out, [0, 4, 104, 255]);
    }
}
