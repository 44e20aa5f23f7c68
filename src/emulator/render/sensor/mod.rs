//! The sensor pass: mean electrons to digital numbers, by the linear model of EMVA 1288 release
//! 4.0 (section 2): shot noise, full well, read noise, system gain, black level, converter.

mod noise;
mod normal;
mod philox;
mod poisson;

use crate::profile::Sensor as Parameters;
use crate::protocol::PixelFormat;
use crate::simd::widest;
use noise::Noise;

/// The sensor at one gain, for one frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sensor {
    full_well_e: f32,
    gain_dn_per_e: f32,
    black_dn: f32,
    full_scale_dn: f32,
    /// Words of two bytes.
    wide: bool,
    noise: Option<Noise>,
}

impl Sensor {
    /// `noise` is the seed and the shot's noise id, or `None` for no shot and read noise.
    pub(super) fn new(sensor: &Parameters, gain_db: f64, noise: Option<(u64, u64)>) -> Self {
        let gain = sensor.gain_at(gain_db);
        let full_scale = sensor.full_scale_dn();
        let (full_well_e, read_noise_e) = (sensor.full_well_e, sensor.read_noise_e);
        // Whether a full well reads the converter's last number whatever the read noise.
        let least = full_well_e - f64::from(noise::FARTHEST) * read_noise_e;
        let hidden = least * gain + sensor.black_level_dn >= full_scale - 0.5;
        let noise = noise.map(|(seed, id)| {
            Noise::new([seed, id], read_noise_e as f32, full_well_e as f32, hidden)
        });
        Self {
            full_well_e: full_well_e as f32,
            gain_dn_per_e: gain as f32,
            black_dn: sensor.black_level_dn as f32,
            full_scale_dn: full_scale as f32,
            wide: sensor.native_format() == PixelFormat::Y16,
            noise,
        }
    }

    /// Digital numbers of the pixels from `first` on, a multiple of the random numbers' block of
    /// 32. `electrons` holds their means and is used as scratch.
    pub(super) fn run(&self, first: usize, electrons: &mut [f32], out: &mut [u8]) {
        match &self.noise {
            Some(noise) => noise::draw(noise, first, electrons),
            None => clip(self.full_well_e, electrons),
        }
        if self.wide {
            quantise_words(self, electrons, out);
        } else {
            quantise_bytes(self, electrons, out);
        }
    }

    /// Noise-free signal in digital numbers, not rounded, of a mean number of electrons.
    pub(super) fn signal_dn(&self, electrons: f32) -> f32 {
        let e = electrons.min(self.full_well_e);
        (e * self.gain_dn_per_e + self.black_dn).min(self.full_scale_dn)
    }

    /// Gain, black level, and rounding to the converter's range: a word in the low bits.
    #[inline(always)]
    fn convert(&self, electrons: f32) -> u32 {
        /// Adding it leaves whole numbers in the low bits, rounded to the nearest.
        const WHOLE: f32 = (1u32 << 23) as f32;
        let dn = electrons * self.gain_dn_per_e + self.black_dn;
        let dn = if dn > 0.0 { dn } else { 0.0 };
        let dn = if dn < self.full_scale_dn {
            dn
        } else {
            self.full_scale_dn
        };
        (dn + WHOLE).to_bits()
    }
}

widest! {
    fn clip(full_well_e: f32, electrons: &mut [f32]) => clip_body
}
widest! {
    fn quantise_bytes(sensor: &Sensor, electrons: &[f32], out: &mut [u8]) => quantise_bytes_body
}
widest! {
    fn quantise_words(sensor: &Sensor, electrons: &[f32], out: &mut [u8]) => quantise_words_body
}

#[inline(always)]
fn clip_body(full_well_e: f32, electrons: &mut [f32]) {
    for e in electrons {
        *e = if *e < full_well_e { *e } else { full_well_e };
    }
}

#[inline(always)]
fn quantise_bytes_body(sensor: &Sensor, electrons: &[f32], out: &mut [u8]) {
    for (byte, &e) in out.iter_mut().zip(electrons) {
        *byte = sensor.convert(e) as u8;
    }
}

#[inline(always)]
fn quantise_words_body(sensor: &Sensor, electrons: &[f32], out: &mut [u8]) {
    let (pairs, _) = out.as_chunks_mut();
    for (pair, &e) in pairs.iter_mut().zip(electrons) {
        *pair = (sensor.convert(e) as u16).to_le_bytes();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn saturation_and_black_clip_at_the_converters_ends() {
        let mut sensor = Sensor {
            full_well_e: 1e6,
            gain_dn_per_e: 1.0,
            black_dn: 4.0,
            full_scale_dn: 255.0,
            wide: false,
            noise: None,
        };
        let mut out = [0; 4];
        sensor.run(0, &mut [-9.0, 0.0, 100.4, 1e9], &mut out);
        assert_eq!(out, [0, 4, 104, 255]);
        sensor.full_scale_dn = 65535.0;
        sensor.wide = true;
        let mut out = [0; 8];
        sensor.run(0, &mut [-9.0, 0.4, 1000.6, 1e9], &mut out);
        assert_eq!(out, [0, 0, 4, 0, 0xed, 0x03, 0xff, 0xff]);
    }
}
