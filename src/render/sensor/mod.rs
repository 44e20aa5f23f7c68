//! The sensor pass: converts mean electrons to digital numbers by the linear model of EMVA 1288
//! release 4.0 (section 2): pixel sensitivity, dark current, shot noise, full well, read noise,
//! pixel offset, system gain, black level, converter, and the non-linear response, if any. This
//! module also holds the parameters for the GPU's sensor pass, and computes a sensor's output for
//! given signals.
//!
//! | module | contents |
//! | --- | --- |
//! | `noise` | shot and read noise |
//! | `poisson`, `normal` | Poisson and normal numbers from random words |
//! | `philox`, `elementary` | random words; logarithm and exponential |
//! | `fixed` | PRNU and DSNU |
//! | `bloom` | blooming |
//! | `response` | non-linear response |

pub(super) mod bloom;
mod elementary;
mod fixed;
mod noise;
mod normal;
mod philox;
mod poisson;
mod response;

pub(super) use fixed::FixedPattern;

use super::{Plan, Term};
use noise::Noise;
use phasmid_core::simd::widest;
use phasmid_profile::Sensor as Parameters;
use phasmid_protocol::PixelFormat;
use response::Response;

/// The sensor at one gain and exposure, for one frame, with the terms that the plan includes.
#[derive(Clone, Copy)]
pub(super) struct Sensor<'a> {
    linear: Linear,
    /// Whether a pixel takes two bytes.
    wide: bool,
    dark_e: Option<f32>,
    fixed: Option<&'a FixedPattern>,
    noise: Option<Noise>,
    response: Option<Response>,
}

/// Conversion from electrons to linear digital numbers.
#[derive(Debug, Clone, Copy)]
struct Linear {
    full_well_e: f32,
    gain_dn_per_e: f32,
    black_dn: f32,
    full_scale_dn: f32,
}

impl<'a> Sensor<'a> {
    /// Creates the model. `noise` is the seed and the shot's noise id, used if the plan includes
    /// shot and read noise. `fixed` is the fixed pattern, used if the plan includes it.
    pub(super) fn new(
        sensor: &Parameters,
        plan: &Plan,
        (gain_db, exposure_s): (f64, f64),
        noise: (u64, u64),
        fixed: Option<&'a FixedPattern>,
    ) -> Self {
        let gain = sensor.gain_at(gain_db);
        let full_scale = sensor.full_scale_dn();
        let (full_well_e, read_noise_e) = (sensor.full_well_e, sensor.read_noise_e);
        // Whether a pixel at the full well always reads as the converter's maximum, whatever its
        // read noise and offset.
        let far = f64::from(noise::FARTHEST);
        let least = full_well_e - far * (read_noise_e + sensor.dsnu_e);
        let hidden = least * gain + sensor.black_level_dn >= full_scale - 0.5;
        let noise = plan.has(Term::Noise).then(|| {
            let key = [noise.0, noise.1];
            Noise::new(key, read_noise_e as f32, full_well_e as f32, hidden)
        });
        Self {
            linear: Linear {
                full_well_e: full_well_e as f32,
                gain_dn_per_e: gain as f32,
                black_dn: sensor.black_level_dn as f32,
                full_scale_dn: full_scale as f32,
            },
            wide: sensor.native_format() == PixelFormat::Y16,
            dark_e: plan
                .has(Term::DarkCurrent)
                .then(|| sensor.dark_e(exposure_s) as f32),
            fixed,
            noise,
            response: plan
                .has(Term::CameraResponse)
                .then(|| Response::new(&sensor.response, full_scale)),
        }
    }

    /// Returns the full-well capacity in electrons.
    pub(super) fn full_well_e(&self) -> f32 {
        self.linear.full_well_e
    }

    /// Converts the mean photoelectrons of pixels that start at index `first` to mean collected
    /// electrons.
    pub(super) fn gather(&self, first: usize, electrons: &mut [f32]) {
        if let Some(fixed) = self.fixed {
            fixed.scale(first, electrons);
        }
        if let Some(dark_e) = self.dark_e {
            for e in electrons.iter_mut() {
                *e += dark_e;
            }
        }
    }

    /// Computes the digital numbers of pixels that start at index `first`, which must be a multiple
    /// of the random number block size of 32. `electrons` holds the mean collected electrons of
    /// these pixels, and is overwritten.
    pub(super) fn read(&self, first: usize, electrons: &mut [f32], out: &mut [u8]) {
        match &self.noise {
            Some(noise) => noise::draw(noise, first, electrons),
            None => clip(self.linear.full_well_e, electrons),
        }
        if let Some(fixed) = self.fixed {
            fixed.offset(first, electrons);
        }
        match (&self.response, self.wide) {
            (None, false) => quantise_bytes(&self.linear, electrons, out),
            (None, true) => quantise_words(&self.linear, electrons, out),
            (Some(response), wide) => {
                bend(response, &self.linear, electrons);
                let bent = Linear {
                    gain_dn_per_e: 1.0,
                    black_dn: 0.0,
                    ..self.linear
                };
                if wide {
                    quantise_words(&bent, electrons, out);
                } else {
                    quantise_bytes(&bent, electrons, out);
                }
            }
        }
    }

    /// Computes the unrounded digital numbers, without shot and read noise, of pixels that start at
    /// index `first`. `electrons` holds the mean collected electrons of these pixels, and is
    /// overwritten.
    pub(super) fn expect(&self, first: usize, electrons: &mut [f32], out: &mut [f32]) {
        clip(self.linear.full_well_e, electrons);
        if let Some(fixed) = self.fixed {
            fixed.offset(first, electrons);
        }
        if let Some(response) = &self.response {
            bend(response, &self.linear, electrons);
            out.copy_from_slice(electrons);
        } else {
            for (dn, &e) in out.iter_mut().zip(electrons.iter()) {
                *dn = self.linear.dn(e);
            }
        }
    }
}

impl Linear {
    /// Applies gain, black level and the converter's range; NaN reads as zero signal.
    #[inline(always)]
    fn dn(&self, electrons: f32) -> f32 {
        let dn = electrons * self.gain_dn_per_e + self.black_dn;
        let dn = if dn > 0.0 { dn } else { 0.0 };
        if dn < self.full_scale_dn {
            dn
        } else {
            self.full_scale_dn
        }
    }

    /// Returns a word whose low bits hold the nearest integer digital number.
    #[inline(always)]
    fn word(&self, electrons: f32) -> u32 {
        /// Adding this number leaves the integer in the low bits of the sum.
        const WHOLE: f32 = (1u32 << 23) as f32;
        (self.dn(electrons) + WHOLE).to_bits()
    }
}

widest! {
    fn clip(full_well_e: f32, electrons: &mut [f32]) => clip_body
}
widest! {
    fn bend(response: &Response, linear: &Linear, electrons: &mut [f32]) => bend_body
}
widest! {
    fn quantise_bytes(linear: &Linear, electrons: &[f32], out: &mut [u8]) => quantise_bytes_body
}
widest! {
    fn quantise_words(linear: &Linear, electrons: &[f32], out: &mut [u8]) => quantise_words_body
}

#[inline(always)]
fn clip_body(full_well_e: f32, electrons: &mut [f32]) {
    for e in electrons {
        *e = if *e < full_well_e { *e } else { full_well_e };
    }
}

/// Converts electrons to unrounded digital numbers after the response.
#[inline(always)]
fn bend_body(response: &Response, linear: &Linear, electrons: &mut [f32]) {
    for e in electrons {
        *e = response.bend(linear.dn(*e));
    }
}

#[inline(always)]
fn quantise_bytes_body(linear: &Linear, electrons: &[f32], out: &mut [u8]) {
    for (byte, &e) in out.iter_mut().zip(electrons) {
        *byte = linear.word(e) as u8;
    }
}

#[inline(always)]
fn quantise_words_body(linear: &Linear, electrons: &[f32], out: &mut [u8]) {
    let (pairs, _) = out.as_chunks_mut();
    for (pair, &e) in pairs.iter_mut().zip(electrons) {
        *pair = (linear.word(e) as u16).to_le_bytes();
    }
}

/// All parameters of [`Sensor`] except its fixed pattern.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Numbers {
    /// Seed, and noise id of the shot.
    pub(crate) key: [u64; 2],
    pub(crate) read_noise_e: f32,
    pub(crate) full_well_e: f32,
    /// Mean in electrons above which shot and read noise are drawn separately; infinite if they are
    /// never drawn separately.
    pub(crate) apart_from_e: f32,
    pub(crate) dark_e: f32,
    pub(crate) gain_dn_per_e: f32,
    pub(crate) black_dn: f32,
    pub(crate) full_scale_dn: f32,
    /// Exponent of the response; 1 if it is linear.
    pub(crate) exponent: f32,
    /// Whether a pixel takes two bytes.
    pub(crate) wide: bool,
}

impl Sensor<'_> {
    /// Returns the parameters; terms that the plan does not include get neutral values.
    pub(crate) fn numbers(&self) -> Numbers {
        let noise = self.noise.as_ref();
        Numbers {
            key: noise.map_or([0; 2], |n| n.key),
            read_noise_e: noise.map_or(0.0, |n| n.read_noise_e),
            full_well_e: self.linear.full_well_e,
            apart_from_e: noise.map_or(f32::INFINITY, |n| n.apart_from_e),
            dark_e: self.dark_e.unwrap_or(0.0),
            gain_dn_per_e: self.linear.gain_dn_per_e,
            black_dn: self.linear.black_dn,
            full_scale_dn: self.linear.full_scale_dn,
            exponent: self.response.as_ref().map_or(1.0, |r| r.exponent),
            wide: self.wide,
        }
    }
}

/// Returns a sensor's output at base gain for given mean signals in digital numbers. Models shot
/// noise, read noise, full well, converter and response, without dark current and fixed-pattern
/// noise. The output has two bytes per pixel, little-endian, if the sensor has more than 8 bits.
/// `seed` and `noise_id` seed the noise as they do for a frame.
pub fn read_out(sensor: &Parameters, [seed, noise_id]: [u64; 2], mean_dn: &[f32]) -> Vec<u8> {
    let mut plan = Plan::default();
    plan.set(Term::Noise, !sensor.noiseless);
    plan.set(Term::CameraResponse, sensor.response.is_bent());
    let chain = Sensor::new(sensor, &plan, (0.0, 0.0), (seed, noise_id), None);
    let (gain, black) = (sensor.gain_dn_per_e, sensor.black_level_dn);
    let mut electrons: Vec<f32> = mean_dn
        .iter()
        .map(|&dn| ((f64::from(dn) - black) / gain).max(0.0) as f32)
        .collect();
    let mut out = vec![0; mean_dn.len() * sensor.native_format().bytes_per_pixel()];
    chain.read(0, &mut electrons, &mut out);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_profile::Profile;

    #[test]
    fn saturation_and_black_clip_at_the_converters_ends() {
        let mut linear = Linear {
            full_well_e: 1e6,
            gain_dn_per_e: 1.0,
            black_dn: 4.0,
            full_scale_dn: 255.0,
        };
        let mut out = [0; 5];
        let electrons = [-9.0, 0.0, 100.4, 1e9, f32::NAN];
        quantise_bytes(&linear, &electrons, &mut out);
        assert_eq!(out, [0, 4, 104, 255, 0]);
        linear.full_scale_dn = 65535.0;
        let mut out = [0; 8];
        quantise_words(&linear, &[-9.0, 0.4, 1000.6, 1e9], &mut out);
        assert_eq!(out, [0, 0, 4, 0, 0xed, 0x03, 0xff, 0xff]);
    }

    /// The mean and variance of uniformly lit frames match the noise model.
    #[test]
    fn noise_of_flat_fields_matches_the_model() {
        let sensor = Profile::load("pmp-bench").unwrap().camera.sensor;
        let model = sensor.noise_model(0.0, 0.0);
        for (id, mean) in [20.0f32, 90.3, 180.7].into_iter().enumerate() {
            let levels = read_out(&sensor, [1, id as u64], &[mean; 100_000]);
            let n = levels.len() as f64;
            let found = levels.iter().map(|&l| f64::from(l)).sum::<f64>() / n;
            let squares: f64 = levels.iter().map(|&l| (f64::from(l) - found).powi(2)).sum();
            let expected = model.variance_dn2(mean.into());
            assert!((found - f64::from(mean)).abs() < 4.0 * (expected / n).sqrt());
            // The relative standard error of a variance from n values is sqrt(2 / n).
            assert!((squares / n / expected - 1.0).abs() < 4.0 * (2.0 / n).sqrt());
        }
    }
}
