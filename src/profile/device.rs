//! A device profile: everything that makes one scanner model differ from another.

use super::check::{self, Check};
use super::{TomlSource, builtin};
use crate::error::Result;
use crate::geometry::{Lens, NoiseModel, Pose, Rig, View};
use crate::pattern::{Manifest, ManifestFrame, ProjectorSize};
use crate::protocol::PixelFormat;
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A scanner model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// Name by which it is chosen.
    pub name: String,
    /// One line for listings.
    pub description: String,
    /// What the device says of itself.
    pub identity: Identity,
    /// The camera.
    pub camera: Camera,
    /// The projector.
    pub projector: Projector,
    /// How it enumerates as a USB device.
    #[serde(default)]
    pub usb: super::Usb,
    /// The sequences in the device's memory; the first is selected at power-on.
    pub sequence: Vec<Sequence>,
    /// Folder that pattern images are relative to; the profile file's own.
    #[serde(skip)]
    pub folder: PathBuf,
}

/// The fields of `*IDN?` (IEEE 488.2, 10.14); no commas.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    /// Manufacturer.
    pub manufacturer: String,
    /// Model.
    pub model: String,
    /// Serial number.
    pub serial: String,
    /// Firmware version.
    pub firmware: String,
}

/// Optics and timing of the camera. Its frame is the rig's frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Focal length of the lens in millimetres.
    pub focal_length_mm: f64,
    /// Width of the sensor that the columns divide, in millimetres; pixels are square.
    pub sensor_width_mm: f64,
    /// Principal point in pixels; the image's centre when absent.
    #[serde(default)]
    pub principal_point_px: Option<[f64; 2]>,
    /// OpenCV's k1 k2 p1 p2 k3.
    #[serde(default)]
    pub distortion: [f64; 5],
    /// Working f-number, for the light that reaches the sensor.
    pub f_number: f64,
    /// Pixel format on the link at power-on.
    pub format: PixelFormat,
    /// Puts the embedded data line above each image, one row more on every link: see
    /// [`data_line`](crate::protocol::data_line).
    #[serde(default)]
    pub data_line: bool,
    /// Exposure at power-on in microseconds.
    pub exposure_us: f64,
    /// Shortest and longest exposure in microseconds.
    pub exposure_range_us: [f64; 2],
    /// Largest gain in decibels above the sensor's base gain; 0 at power-on.
    pub max_gain_db: f64,
    /// Interval of free-running frames in microseconds.
    pub frame_interval_us: f64,
    /// The sensor.
    pub sensor: Sensor,
}

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

/// The projector, an inverse camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Projector {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Distance over picture width; pixels are square.
    pub throw_ratio: f64,
    /// Shift of the principal point from the picture's centre in pixels.
    #[serde(default)]
    pub lens_shift_px: [f64; 2],
    /// Pupil in the rig's frame in millimetres.
    pub position_mm: [f64; 3],
    /// Rotation in degrees about the fixed x, then y, then z axis of the rig.
    #[serde(default)]
    pub rotation_deg: [f64; 3],
    /// OpenCV's k1 k2 p1 p2 k3.
    #[serde(default)]
    pub distortion: [f64; 5],
    /// Bits of a displayed level, 1 to 8.
    pub bits: u32,
    /// Radiant intensity of full white in watts per steradian, the same over the field.
    pub radiant_intensity_w_sr: f64,
    /// Wavelength of the light in nanometres.
    pub wavelength_nm: f64,
}

/// A pattern sequence in the device's memory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sequence {
    /// Name by which `SEQuence:SELect` takes it.
    pub name: String,
    /// Time from one pattern to the next in microseconds; at least the exposure.
    pub period_us: f64,
    /// The patterns in order.
    pub frame: Vec<ManifestFrame>,
}

impl Profile {
    /// Loads a built-in profile by its name, or else a file by its path.
    ///
    /// # Errors
    /// A name that is neither, unreadable files, and all that [`Self::parse`] refuses.
    pub fn load(name_or_path: &str) -> Result<Self> {
        let (source, folder) = builtin::profile_source(name_or_path)?;
        let mut profile = Self::from_source(&source)?;
        profile.folder = folder;
        Ok(profile)
    }

    /// Reads and checks a profile from text; `place` stands for the file in messages.
    ///
    /// # Errors
    /// Syntax, unknown fields, wrong types and impossible values, each with its line.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        Self::from_source(&TomlSource::new(text, place))
    }

    fn from_source(source: &TomlSource) -> Result<Self> {
        let profile: Self = source.deserialize()?;
        check::profile(&profile, &Check::new(source))?;
        Ok(profile)
    }

    /// The manifest of one of the profile's sequences.
    pub fn manifest(&self, sequence: &Sequence) -> Manifest {
        Manifest {
            projector: ProjectorSize {
                width_px: self.projector.width_px,
                height_px: self.projector.height_px,
            },
            frame: sequence.frame.clone(),
        }
    }

    /// The rig as it was designed: what a calibration would find if it were perfect.
    pub fn nominal_rig(&self) -> Rig {
        Rig {
            camera: self.camera.view(),
            projector: self.projector.view(),
            noise: Some(self.camera.sensor.noise_model(0.0)),
        }
    }
}

impl Camera {
    /// Intrinsics and pose: the rig's frame is the camera's.
    pub fn view(&self) -> View {
        let focal_px = self.focal_length_mm / self.pixel_pitch_mm();
        View {
            lens: Lens {
                width_px: self.width_px,
                height_px: self.height_px,
                focal_px: DVec2::splat(focal_px),
                principal_px: self.principal_point_px.map_or(
                    DVec2::new(
                        (f64::from(self.width_px) - 1.0) / 2.0,
                        (f64::from(self.height_px) - 1.0) / 2.0,
                    ),
                    DVec2::from_array,
                ),
                distortion: self.distortion,
            },
            rig_from_view: Pose::IDENTITY,
        }
    }

    /// Side of a square pixel in millimetres.
    pub fn pixel_pitch_mm(&self) -> f64 {
        self.sensor_width_mm / f64::from(self.width_px)
    }
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

impl Projector {
    /// Intrinsics and pose of the inverse camera.
    pub fn view(&self) -> View {
        View {
            lens: Lens {
                width_px: self.width_px,
                height_px: self.height_px,
                focal_px: DVec2::splat(self.throw_ratio * f64::from(self.width_px)),
                principal_px: DVec2::new(
                    (f64::from(self.width_px) - 1.0) / 2.0,
                    (f64::from(self.height_px) - 1.0) / 2.0,
                ) + DVec2::from_array(self.lens_shift_px),
                distortion: self.distortion,
            },
            rig_from_view: Pose::from_xyz_deg(
                DVec3::from_array(self.position_mm),
                DVec3::from_array(self.rotation_deg),
            ),
        }
    }
}
