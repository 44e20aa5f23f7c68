//! Fixed-pattern noise of one device: differences between its pixels, which are the same in every
//! frame.
//!
//! EMVA 1288 release 4.0, section 4, describes this noise by two standard deviations over the
//! pixels. PRNU is the standard deviation of the sensitivities, which scale a pixel's mean electrons
//! before shot noise. DSNU is the standard deviation of the dark signals. DSNU is measured at short
//! exposures, where the readout dominates, so it is modelled as an offset that is added after the
//! full well, causes no shot noise and may be negative.

use super::normal::{Tails, quantiles};
use super::philox::{self, BLOCK};
use phasmid_core::simd::widest;
use phasmid_profile::Sensor as Parameters;

/// Draw indices, which differ from the draw indices of the temporal noise.
const DRAW_SENSITIVITY: u32 = 2;
const DRAW_OFFSET: u32 = 3;

/// Sensitivity and offset of each pixel of a sensor.
pub(crate) struct FixedPattern {
    /// Sensitivity relative to the mean over all pixels.
    sensitivity: Vec<f32>,
    offset_e: Vec<f32>,
}

impl FixedPattern {
    /// Generates the fixed pattern of the device with seed `sensor.pattern_seed`.
    pub(crate) fn new(sensor: &Parameters, pixels: usize) -> Self {
        let draw = |index| normal_numbers([sensor.pattern_seed, 0], index, pixels);
        let prnu = (sensor.prnu_percent / 100.0) as f32;
        let mut sensitivity = draw(DRAW_SENSITIVITY);
        for s in &mut sensitivity {
            *s = (1.0 + prnu * *s).max(0.0);
        }
        let mut offset_e = draw(DRAW_OFFSET);
        for o in &mut offset_e {
            *o *= sensor.dsnu_e as f32;
        }
        Self {
            sensitivity,
            offset_e,
        }
    }

    /// Returns the sensitivity and the offset in electrons of each pixel.
    pub(crate) fn pixels(&self) -> impl Iterator<Item = [f32; 2]> {
        let pairs = self.sensitivity.iter().zip(&self.offset_e);
        pairs.map(|(&sensitivity, &offset_e)| [sensitivity, offset_e])
    }

    /// Scales the mean electrons of pixels, starting with pixel `first`, by their sensitivities.
    pub(super) fn scale(&self, first: usize, electrons: &mut [f32]) {
        multiply(&self.sensitivity[first..first + electrons.len()], electrons);
    }

    /// Adds the offsets, in electrons, of pixels starting with pixel `first`.
    pub(super) fn offset(&self, first: usize, electrons: &mut [f32]) {
        add(&self.offset_e[first..first + electrons.len()], electrons);
    }
}

fn normal_numbers(key: [u64; 2], draw: u32, pixels: usize) -> Vec<f32> {
    let mut words = vec![[0; BLOCK]; pixels.div_ceil(BLOCK)];
    philox::fill(key, 0, draw, &mut words);
    let normal = words.iter().flat_map(|w| quantiles(&Tails::of_words(w)));
    normal.take(pixels).collect()
}

widest! {
    fn multiply(by: &[f32], values: &mut [f32]) => multiply_body
}
widest! {
    fn add(what: &[f32], values: &mut [f32]) => add_body
}

#[inline(always)]
fn multiply_body(by: &[f32], values: &mut [f32]) {
    for (v, by) in values.iter_mut().zip(by) {
        *v *= by;
    }
}

#[inline(always)]
fn add_body(what: &[f32], values: &mut [f32]) {
    for (v, what) in values.iter_mut().zip(what) {
        *v += what;
    }
}
