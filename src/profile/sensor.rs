//! The sensor of a profile, in the terms of EMVA 1288.

use super::check::Check;
use crate::error::Result;
use crate::geometry::NoiseModel;
use crate::protocol::PixelFormat;
use serde::{Deserialize, Serialize};

/// A sensor in the terms of EMVA 1288.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// Electrons per photon at the projector's wavelength, 0 to 1.
    pub quantum_efficiency: f64,
    /// Electrons that a pixel holds.
    pub full_well_e: f64,
    /// Standard deviation of the dark signal in electrons.
    pub read_noise_e: f64,
    /// Overall system gain K at 0 dB, in digital numbers per electron.
    pub gain_dn_per_e: f64,
    /// Digital number of no light.
    pub black_level_dn: f64,
    /// Bits of the converter, 8 to 16.
    pub bits: u32,
    /// Leaves shot and read noise out: chosen at run time, not a property of a model.
    #[serde(skip)]
    pub noiseless: bool,
}

impl Sensor {
    /// What the converter's words are: GREY up to 8 bits, Y16 beyond.
    pub fn native_format(&self) -> PixelFormat {
        if self.bits <= 8 {
            PixelFormat::Grey
        } else {
            PixelFormat::Y16
        }
    }

    /// Formats that a link can carry the converter's words in.
    pub fn formats(&self) -> &'static [PixelFormat] {
        if self.bits <= 8 {
            &[PixelFormat::Grey, PixelFormat::Yuyv]
        } else {
            &[PixelFormat::Y16]
        }
    }

    /// Largest digital number.
    pub fn full_scale_dn(&self) -> f64 {
        f64::from((1u32 << self.bits) - 1)
    }

    /// System gain in DN per electron at a gain in decibels (20 dB a factor of ten).
    pub fn gain_at(&self, gain_db: f64) -> f64 {
        self.gain_dn_per_e * 10f64.powf(gain_db / 20.0)
    }

    /// The noise that a host may expect at a gain in decibels.
    pub fn noise_model(&self, gain_db: f64) -> NoiseModel {
        let gain = self.gain_at(gain_db);
        let full_well_dn = self.black_level_dn + gain * self.full_well_e;
        NoiseModel {
            gain_dn_per_e: if self.noiseless { 0.0 } else { gain },
            read_noise_dn: if self.noiseless {
                0.0
            } else {
                gain * self.read_noise_e
            },
            black_level_dn: self.black_level_dn,
            saturation_dn: full_well_dn.min(self.full_scale_dn()).floor(),
        }
    }
}

pub(super) fn check(s: &Sensor, format: PixelFormat, check: &Check<'_>) -> Result<()> {
    check.within(
        "camera.sensor.quantum_efficiency",
        s.quantum_efficiency,
        0.001..=1.0,
    )?;
    check.within("camera.sensor.full_well_e", s.full_well_e, 100.0..=1e7)?;
    check.within("camera.sensor.read_noise_e", s.read_noise_e, 0.0..=1e4)?;
    check.within("camera.sensor.gain_dn_per_e", s.gain_dn_per_e, 1e-6..=1e4)?;
    let bits = match format {
        PixelFormat::Grey | PixelFormat::Yuyv => 8..=8,
        PixelFormat::Y16 => 9..=16,
    };
    check.within("camera.sensor.bits", s.bits, bits)?;
    let half = s.full_scale_dn() / 2.0;
    check.within("camera.sensor.black_level_dn", s.black_level_dn, 0.0..=half)
}
