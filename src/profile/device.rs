//! Device profile: the complete description of a scanner model.

use super::{Calibration, Camera, FactoryCalibration, Projector, Sequence, Settings, TomlSource};
use super::{builtin, calibration, camera, control, factory_calibration, projector, sequence, usb};
use phasmid_core::check::{Check, name};
use phasmid_core::error::Result;
use phasmid_geometry::Rig;
use phasmid_pattern::{Manifest, ProjectorSize};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A scanner model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// Name used to select the profile.
    pub name: String,
    /// One line for listings.
    #[serde(default)]
    pub description: String,
    /// Identity that the device reports.
    #[serde(default)]
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
    /// The sequences in the device's memory; the first is selected at power-on. When absent, there are
    /// `4-step`, fringes of 16 px in 4 steps and a Gray code along x, white and black, and `4-step-xy`,
    /// the same along both axes; both show a pattern every `camera.frame_interval_us`.
    #[serde(default)]
    pub sequence: Vec<Sequence>,
    /// Folder of the profile file, to which pattern image paths are relative.
    #[serde(skip)]
    pub folder: PathBuf,
}

/// Fields of `*IDN?` (IEEE 488.2, 10.14), without commas.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Identity {
    /// Manufacturer.
    pub manufacturer: String,
    /// Model; the profile's name when absent or empty.
    pub model: String,
    /// Serial number.
    pub serial: String,
    /// Firmware version.
    pub firmware: String,
}

impl Default for Identity {
    fn default() -> Self {
        Self {
            manufacturer: "Phasmid".to_owned(),
            model: String::new(),
            serial: "0001".to_owned(),
            firmware: "0.1.0".to_owned(),
        }
    }
}

impl Profile {
    /// Loads a built-in profile by its name, or else a file by its path.
    ///
    /// # Errors
    /// Returns an error if the name is neither built in nor a file, if the file cannot be read, or
    /// if [`Self::parse`] fails.
    pub fn load(name_or_path: &str) -> Result<Self> {
        Self::load_with(name_or_path, &Settings::default())
    }

    /// Loads a profile as [`Self::load`] does, with settings on top.
    ///
    /// # Errors
    /// Returns an error as [`Self::load`] does, or if a setting names no field or an invalid value.
    pub fn load_with(name_or_path: &str, settings: &Settings) -> Result<Self> {
        let (source, folder) = builtin::profile_source(name_or_path)?;
        let mut profile = Self::from_source(&source.with(&settings.profile))?;
        profile.folder = folder;
        Ok(profile)
    }

    /// Parses and checks a profile; `place` is the file name used in messages. Paths of files are
    /// relative to the working directory.
    ///
    /// # Errors
    /// Returns an error with its line on a syntax error, an unknown field, a wrong type or an
    /// invalid value.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        let source = TomlSource::new(text, place);
        Self::from_source(&builtin::extended_profile(source, Path::new(""))?)
    }

    pub(super) fn from_source(source: &TomlSource) -> Result<Self> {
        let mut profile: Self = source.deserialize()?;
        profile.settle();
        profile.control.places = control::Places::of(source);
        Check::all(source, |all| check(&profile, all))?;
        Ok(profile)
    }

    /// Sets what is absent and follows from other fields.
    fn settle(&mut self) {
        if self.identity.model.is_empty() {
            self.identity.model.clone_from(&self.name);
        }
        self.camera.sensor.settle();
        if self.sequence.is_empty() {
            let frames_us = self.camera.frame_interval_us;
            self.sequence
                .extend(Sequence::plain(&self.projector, frames_us));
        }
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
        check.section(|check| check_identity(text, field, check));
    }
    let camera = check.section(|check| camera::check(&p.camera, check));
    let projector = check.section(|check| projector::check(&p.projector, check));
    check.section(|check| usb::check(&p.usb, check));
    check.section(|check| control::check(&p.control, check));
    if !(camera && projector) {
        return Ok(());
    }
    check.that(
        !p.sequence.is_empty() && p.sequence.len() <= 64,
        "sequence",
        format!("{} sequences", p.sequence.len()),
        "1 to 64 sequences",
    )?;
    for (i, s) in p.sequence.iter().enumerate() {
        check.section(|check| sequence::check(s, i, p, check));
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

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_core::source::Setting;

    const LEAST: &str = "name = \"least\"
[camera]
width_px = 640
height_px = 480
focal_length_mm = 6.0
sensor_width_mm = 4.8
[projector]
width_px = 854
height_px = 480
throw_ratio = 1.4
position_mm = [150.0, 0.0, 0.0]
";

    #[test]
    fn only_geometry_has_no_default() {
        let profile = Profile::parse(LEAST, "least.toml").unwrap();
        assert_eq!(profile.identity.model, "least");
        let sensor = &profile.camera.sensor;
        let full_dn = sensor.black_level_dn + sensor.gain_dn_per_e * sensor.full_well_e;
        assert!((full_dn - 255.0).abs() < 1e-9);
        let [sequence, both] = &profile.sequence[..] else {
            panic!("{:?}", profile.sequence)
        };
        // 4 fringes, 54 of them across 854 columns, so 6 bits, the half-cell bit, white and black.
        assert_eq!(sequence.frame.len(), 4 + 6 + 1 + 2);
        assert_eq!(sequence.period_us, 33_333.0);
        assert_eq!(both.frame.len(), (4 + 6 + 1) + (4 + 5 + 1) + 2);
        let nothing = Profile::parse("", "m.toml").unwrap_err().to_string();
        for field in ["name", "camera", "projector"] {
            assert!(
                nothing.contains(&format!("missing field `{field}`")),
                "{nothing}"
            );
        }
        assert_eq!(nothing.lines().count(), 3, "{nothing}");
    }

    #[test]
    fn all_values_out_of_range_are_reported_together() {
        let text = LEAST
            .replace("height_px = 480\nfocal", "height_px = 2\nfocal")
            .replace("throw_ratio = 1.4", "throw_ratio = -1")
            .replace("[projector]", "[camera.sensor]\nbits = 200\n[projector]");
        let message = Profile::parse(&text, "m.toml").unwrap_err().to_string();
        for part in [
            "m.toml:4: camera.height_px: 2;",
            "m.toml:8: camera.sensor.bits: 200;",
            "m.toml:12: projector.throw_ratio: -1;",
        ] {
            assert!(message.contains(part), "{part} not in: {message}");
        }
    }

    #[test]
    fn a_profile_extends_a_built_in_one_and_settings_override_it() {
        let text = "extends = \"webcam-grey\"\nname = \"own\"\n[camera.sensor]\nread_noise_e = 3\n";
        let own = Profile::parse(text, "own.toml").unwrap();
        let mut expected = Profile::load("webcam-grey").unwrap();
        expected.name = "own".to_owned();
        expected.camera.sensor.read_noise_e = 3.0;
        expected.control.places = own.control.places.clone();
        assert_eq!(own, expected);

        let set = |text: &str| Settings::new([text.parse::<Setting>().unwrap()]);
        let noisier = set("camera.sensor.read_noise_e=5").unwrap();
        let noisier = Profile::load_with("webcam-grey", &noisier).unwrap();
        assert_eq!(noisier.camera.sensor.read_noise_e, 5.0);
        let wrong = set("camera.sensor.read_noise_e=-5").unwrap();
        let message = Profile::load_with("webcam-grey", &wrong)
            .unwrap_err()
            .to_string();
        assert!(
            message.starts_with("--set camera.sensor.read_noise_e=-5: "),
            "{message}"
        );
        let misspelt = set("camera.sensor.raed_noise_e=5").unwrap();
        let message = Profile::load_with("webcam-grey", &misspelt)
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("did you mean `read_noise_e`?"),
            "{message}"
        );
        let message = set("camrea.width_px=5").unwrap_err().to_string();
        assert!(message.contains("did you mean camera?"), "{message}");
    }

    #[test]
    fn a_station_is_no_profile() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("own.toml"), "name = \"a\"\n[[device]]\n").unwrap();
        let own = folder.path().join("own.toml").display().to_string();
        for name in ["two-pods", own.as_str()] {
            let message = Profile::load(name).unwrap_err().to_string();
            assert!(
                message.contains("a station, which lists several devices"),
                "{message}"
            );
        }
        let message = Profile::load("/").unwrap_err().to_string();
        assert!(message.contains("nor a regular file"), "{message}");
    }
}
