//! Image sensor of a profile, described by EMVA 1288 parameters.

use super::CameraResponse;
use phasmid_core::check::Check;
use phasmid_core::error::Result;
use phasmid_geometry::NoiseModel;
use phasmid_protocol::PixelFormat;
use serde::{Deserialize, Serialize};

/// Path of the field `gain_dn_per_e` in a profile.
pub(super) const GAIN: &str = "camera.sensor.gain_dn_per_e";

/// An image sensor described by EMVA 1288 parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Sensor {
    /// Electrons per photon at the projector's wavelength, 0 to 1.
    pub quantum_efficiency: f64,
    /// Full-well capacity of a pixel in electrons.
    pub full_well_e: f64,
    /// Standard deviation of the dark signal in electrons.
    pub read_noise_e: f64,
    /// Overall system gain K at 0 dB, in digital numbers per electron; when absent, a full well has the
    /// largest digital number.
    pub gain_dn_per_e: f64,
    /// Digital number without light.
    pub black_level_dn: f64,
    /// Converter resolution in bits, 8 to 16.
    pub bits: u32,
    /// Dark current in electrons per pixel and second, at the sensor's temperature (EMVA 1288
    /// release 4.0, section 2: the mean dark signal grows linearly with the exposure, and its
    /// electrons have shot noise like photoelectrons). 0 disables it.
    pub dark_current_e_s: f64,
    /// Photo response non-uniformity, PRNU1288: standard deviation of the pixels' sensitivities in
    /// per cent of their mean (EMVA 1288 release 4.0, section 4). 0 disables it.
    pub prnu_percent: f64,
    /// Dark signal non-uniformity, DSNU1288: standard deviation in electrons of the pixels' offsets
    /// from the mean dark signal (EMVA 1288 release 4.0, section 4). 0 disables it.
    pub dsnu_e: f64,
    /// Seed of the fixed pattern, independent of the noise seed; identifies one specimen of the
    /// model.
    pub pattern_seed: u64,
    /// Percentage of the charge beyond the full well that spills along the column, half each way,
    /// into unsaturated pixels; an anti-blooming drain removes the rest. 0 disables it.
    pub blooming_percent: f64,
    /// Response curve from linear DN to frame DN.
    pub response: CameraResponse,
    /// Disables shot and read noise. Set at run time, not a property of the model.
    #[serde(skip)]
    pub noiseless: bool,
}

impl Default for Sensor {
    /// Returns a typical sensor of 8 bits.
    fn default() -> Self {
        Self {
            quantum_efficiency: 0.5,
            full_well_e: 10_000.0,
            read_noise_e: 5.0,
            gain_dn_per_e: filling_gain(8, 4.0, 10_000.0),
            black_level_dn: 4.0,
            bits: 8,
            dark_current_e_s: 0.0,
            prnu_percent: 0.0,
            dsnu_e: 0.0,
            pattern_seed: 0,
            blooming_percent: 0.0,
            response: CameraResponse::Linear {},
            noiseless: false,
        }
    }
}

/// Returns the gain at which a full well has the largest digital number.
fn filling_gain(bits: u32, black_level_dn: f64, full_well_e: f64) -> f64 {
    (f64::from(bits).exp2() - 1.0 - black_level_dn) / full_well_e
}

impl Sensor {
    /// Sets `gain_dn_per_e` to the value at which a full well has the largest digital number.
    pub(super) fn fill_range(&mut self) {
        self.gain_dn_per_e = filling_gain(self.bits, self.black_level_dn, self.full_well_e);
    }

    /// Returns the native pixel format of the converter: GREY up to 8 bits, Y16 above.
    pub fn native_format(&self) -> PixelFormat {
        if self.bits <= 8 {
            PixelFormat::Grey
        } else {
            PixelFormat::Y16
        }
    }

    /// Returns the pixel formats in which the camera can deliver the samples. All formats of a
    /// sensor carry the same values.
    pub fn formats(&self) -> &'static [PixelFormat] {
        if self.bits <= 8 {
            &[PixelFormat::Grey, PixelFormat::Yuyv]
        } else if self.bits <= 10 {
            &[PixelFormat::Y16, PixelFormat::Y10, PixelFormat::Y10P]
        } else if self.bits <= 12 {
            &[PixelFormat::Y16, PixelFormat::Y12, PixelFormat::Y12P]
        } else {
            &[PixelFormat::Y16]
        }
    }

    /// Returns the largest digital number.
    pub fn full_scale_dn(&self) -> f64 {
        f64::from((1u32 << self.bits) - 1)
    }

    /// Returns the system gain in DN per electron at a gain in decibels (20 dB is a factor of ten).
    pub fn gain_at(&self, gain_db: f64) -> f64 {
        self.gain_dn_per_e * 10f64.powf(gain_db / 20.0)
    }

    /// Returns the mean dark electrons of an exposure in seconds.
    pub fn dark_e(&self, exposure_s: f64) -> f64 {
        self.dark_current_e_s * exposure_s
    }

    /// Returns the noise model that a host may expect at a gain in decibels and an exposure in
    /// seconds. Dark current contributes to the mean of the dark signal and, as shot noise, to its
    /// variance.
    ///
    /// Fixed-pattern noise is the same in every frame and not included. For a non-linear response
    /// the model is the best straight-line fit of variance over mean from dark to saturation.
    pub fn noise_model(&self, gain_db: f64, exposure_s: f64) -> NoiseModel {
        let gain = self.gain_at(gain_db);
        let dark_e = self.dark_e(exposure_s);
        let full_scale = self.full_scale_dn();
        let black = (self.black_level_dn + gain * dark_e).min(full_scale);
        let full_well_dn = self.black_level_dn + gain * self.full_well_e;
        let saturation = full_well_dn.min(full_scale);
        let dark_variance = gain.powi(2) * (self.read_noise_e.powi(2) + dark_e);
        let (gain, dark_variance) = match self.response {
            _ if self.noiseless => (0.0, 0.0),
            CameraResponse::Linear {} => (gain, dark_variance),
            CameraResponse::Gamma { .. } => self.response.line(
                |dn| dark_variance + gain * (dn - black).max(0.0),
                [black, saturation],
                full_scale,
            ),
        };
        NoiseModel {
            gain_dn_per_e: gain,
            read_noise_dn: dark_variance.sqrt(),
            black_level_dn: self.response.apply(black, full_scale),
            saturation_dn: self.response.apply(saturation, full_scale).floor(),
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
    check.within(
        "camera.sensor.dark_current_e_s",
        s.dark_current_e_s,
        0.0..=1e7,
    )?;
    check.within("camera.sensor.prnu_percent", s.prnu_percent, 0.0..=50.0)?;
    check.within("camera.sensor.dsnu_e", s.dsnu_e, 0.0..=1e5)?;
    check.within(
        "camera.sensor.blooming_percent",
        s.blooming_percent,
        0.0..=100.0,
    )?;
    super::camera_response::check(s.response, check)?;
    // Do not check an absent gain: it follows from other values, which are checked.
    if check.source.has(GAIN) {
        check.within(GAIN, s.gain_dn_per_e, 1e-6..=1e4)?;
    }
    let bits = match format {
        PixelFormat::Grey | PixelFormat::Yuyv => 8..=8,
        PixelFormat::Y10 | PixelFormat::Y10P => 9..=10,
        PixelFormat::Y12 | PixelFormat::Y12P => 11..=12,
        PixelFormat::Y16 => 9..=16,
    };
    let format = check.given("camera.format", format.name());
    check.within_for(
        "camera.sensor.bits",
        s.bits,
        bits,
        &format!(" for camera.format = {format}"),
    )?;
    check.in_range()?;
    check.within_for(
        "camera.sensor.black_level_dn",
        s.black_level_dn,
        0.0..=s.full_scale_dn() / 2.0,
        &format!(
            " for camera.sensor.bits = {}",
            check.given("camera.sensor.bits", s.bits)
        ),
    )
}
