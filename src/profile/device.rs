//! Device profile: the complete description of a scanner model.

use super::{Calibration, Camera, FactoryCalibration, Projector, Sequence, TomlSource};
use super::{builtin, calibration, camera, control, factory_calibration, projector, sequence, usb};
use phasmid_core::check::{Check, name};
use phasmid_core::error::Result;
use phasmid_geometry::Rig;
use phasmid_pattern::{Manifest, ProjectorSize};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A scanner model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// Name used to select the profile.
    pub name: String,
    /// One line for listings.
    pub description: String,
    /// Identity that the device reports.
    pub identity: Identity,
    /// The camera.
    pub camera: Camera,
    /// The projector.
    pub projector: Projector,
    /// USB enumeration.
    #[serde(default)]
    pub usb: super::Usb,
    /// Control port.
    #[serde(default)]
    pub control: super::Control,
    /// Calibration defaults.
    #[serde(default)]
    pub calibration: Calibration,
    /// Calibration that the device reports.
    #[serde(default)]
    pub factory_calibration: FactoryCalibration,
    /// The sequences in the device's memory; the first is selected at power-on.
    pub sequence: Vec<Sequence>,
    /// Folder of the profile file, to which pattern image paths are relative.
    #[serde(skip)]
    pub folder: PathBuf,
}

/// Fields of `*IDN?` (IEEE 488.2, 10.14), without commas.
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

impl Profile {
    /// Loads a built-in profile by its name, or else a file by its path.
    ///
    /// # Errors
    /// Returns an error if the name is neither built in nor a file, if the file cannot be read, or
    /// if [`Self::parse`] fails.
    pub fn load(name_or_path: &str) -> Result<Self> {
        let (source, folder) = builtin::profile_source(name_or_path)?;
        let mut profile = Self::from_source(&source)?;
        profile.folder = folder;
        Ok(profile)
    }

    /// Parses and checks a profile; `place` is the file name used in messages.
    ///
    /// # Errors
    /// Returns an error with its line on a syntax error, an unknown field, a wrong type or an
    /// invalid value.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        Self::from_source(&TomlSource::new(text, place))
    }

    pub(super) fn from_source(source: &TomlSource) -> Result<Self> {
        let mut profile: Self = source.deserialize()?;
        profile.control.places = control::Places::of(source);
        check(&profile, &Check::new(source))?;
        Ok(profile)
    }

    /// Returns the manifest of one of the profile's sequences.
    pub fn manifest(&self, sequence: &Sequence) -> Manifest {
        Manifest {
            projector: ProjectorSize {
                width_px: self.projector.width_px,
                height_px: self.projector.height_px,
            },
            frame: sequence.frame.clone(),
        }
    }

    /// Returns the exact rig, which is what a perfect calibration would find; for what the device
    /// reports see [`Self::factory_rig`].
    pub fn nominal_rig(&self) -> Rig {
        Rig {
            camera: self.camera.view(),
            projector: self.projector.view(),
            noise: Some(
                self.camera
                    .sensor
                    .noise_model(0.0, self.camera.exposure_us * 1e-6),
            ),
            covariance: None,
        }
    }
}

/// Checks a field of `*IDN?`.
pub(super) fn check_identity(text: &str, field: &str, check: &Check<'_>) -> Result<()> {
    let printable = text.chars().all(|c| c.is_ascii_graphic() || c == ' ');
    check.that(
        !text.is_empty() && text.len() <= 64 && printable && !text.contains([',', ';']),
        field,
        format!("{text:?}"),
        "1 to 64 printable ASCII characters without comma or semicolon (IEEE 488.2, 10.14)",
    )
}

fn check(p: &Profile, check: &Check<'_>) -> Result<()> {
    name(&p.name, "name", check)?;
    for (field, text) in [
        ("identity.manufacturer", &p.identity.manufacturer),
        ("identity.model", &p.identity.model),
        ("identity.serial", &p.identity.serial),
        ("identity.firmware", &p.identity.firmware),
    ] {
        check_identity(text, field, check)?;
    }
    camera::check(&p.camera, check)?;
    projector::check(&p.projector, check)?;
    usb::check(&p.usb, check)?;
    control::check(&p.control, check)?;
    check.that(
        !p.sequence.is_empty() && p.sequence.len() <= 64,
        "sequence",
        format!("{} sequences", p.sequence.len()),
        "1 to 64 sequences",
    )?;
    for (i, s) in p.sequence.iter().enumerate() {
        sequence::check(s, i, p, check)?;
        let first = p.sequence.iter().position(|other| other.name == s.name);
        check.that(
            first == Some(i),
            &format!("sequence[{i}].name"),
            format!("{:?}, which is already used", s.name),
            "a unique name",
        )?;
    }
    calibration::check(p, check)?;
    factory_calibration::check(p, check)
}
