//! Device profile: the complete description of a scanner model.

use super::{Calibration, Camera, FactoryCalibration, Projector, Sequence, Settings, TomlSource};
use super::{builtin, calibration, camera, control, projector, sensor, sequence, usb};
use phasmid_core::check::{Check, name};
use phasmid_core::error::Result;
use phasmid_geometry::Rig;
use phasmid_pattern::{Manifest, ProjectorSize};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Maximum number of sequences.
const MAX_SEQUENCES: usize = 64;

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
    #[serde(
        default,
        deserialize_with = "phasmid_core::numbers::at_most::<_, _, MAX_SEQUENCES>"
    )]
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

    /// Loads a profile as [`Self::load`] does, with settings that override its fields.
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
        Self::parse_with(text, place, &Settings::default())
    }

    /// Parses a profile as [`Self::parse`] does, with settings that override its fields.
    ///
    /// # Errors
    /// Returns an error as [`Self::parse`] does, or if a setting names no field or an invalid value.
    pub fn parse_with(text: &str, place: &str, settings: &Settings) -> Result<Self> {
        let source = builtin::extended_profile(TomlSource::new(text, place), Path::new(""))?;
        Self::from_source(&source.with(&settings.profile))
    }

    pub(super) fn from_source(source: &TomlSource) -> Result<Self> {
        Check::read(source, |profile: &mut Self, all| {
            profile.settle(source);
            profile.control.places = control::Places::of(source);
            check(profile, all)
        })
    }

    /// Fills in absent fields whose values follow from other fields.
    fn settle(&mut self, source: &TomlSource) {
        if self.identity.model.is_empty() {
            self.identity.model.clone_from(&self.name);
        }
        if !source.has(sensor::GAIN) {
            self.camera.sensor.fill_range();
        }
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

    /// Returns the calibration sequence: the sequence that `calibration.sequence` names, or else
    /// the first sequence with patterns along both axes.
    pub fn calibration_sequence(&self) -> Option<&Sequence> {
        self.calibration.sequence_among(&self.sequence)
    }

    /// Returns the exact rig, which a perfect calibration would find. The rig that the device
    /// reports is [`Self::factory_rig`].
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
    check.section(|check| name(&p.name, "name", check));
    for (field, text) in [
        ("identity.manufacturer", &p.identity.manufacturer),
        ("identity.model", &p.identity.model),
        ("identity.serial", &p.identity.serial),
        ("identity.firmware", &p.identity.firmware),
    ] {
        // If the model is absent, it is the profile's name, which is checked above.
        if check.source.has(field) {
            check.section(|check| check_identity(text, field, check));
        }
    }
    let camera = check.section(|check| camera::check(&p.camera, check));
    let projector = check.section(|check| projector::check(&p.projector, check));
    check.section(|check| usb::check(&p.usb, check));
    check.section(|check| control::check(&p.control, check));
    if !(camera && projector) {
        return Ok(());
    }
    for (i, s) in p.sequence.iter().enumerate() {
        let is_valid =
            check.section(|check| sequence::check(s, i, (&p.camera, &p.projector), check));
        // All default sequences have the same period, so report an error of that period only once.
        if !is_valid && !check.source.has(&format!("sequence[{i}]")) {
            break;
        }
        let first = p.sequence.iter().position(|other| other.name == s.name);
        check.section(|check| {
            check.that(
                first == Some(i),
                &format!("sequence[{i}].name"),
                format!("{:?}, which is already used", s.name),
                "a unique name",
            )
        });
    }
    check.section(|check| calibration::check(&p.calibration, &p.sequence, check));
    calibration::check_factory(&p.factory_calibration, check)
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
        // Expected frames: 4 fringe steps; 6 Gray-code bits for the 54 periods across 854 columns; the
        // half-cell bit; white and black.
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
            message.starts_with("setting camera.sensor.read_noise_e=-5: "),
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
    fn an_extended_profile_may_replace_sequences_and_alternatives() {
        let x_only = "extends = \"webcam-grey\"\nname = \"own\"
[[sequence]]
name = \"x\"
period_us = 40000
frame = [{ pattern = { kind = \"fringe-set\", axis = \"x\", period_px = 16, steps = 4 } }]
";
        let profile = Profile::parse(x_only, "own.toml").unwrap();
        assert_eq!(profile.calibration.sequence, None);
        let folder = tempfile::tempdir().unwrap();
        let base = folder.path().join("base.toml");
        std::fs::write(&base, format!("{LEAST}response = {{ gamma = 2.2 }}\n")).unwrap();
        let text = format!(
            "extends = {:?}\nname = \"own\"\n[projector.response]\ntable = [0, 0.4, 1]\n",
            base.display().to_string()
        );
        let profile = Profile::parse(&text, "own.toml").unwrap();
        let table = crate::Response::Table(vec![0.0, 0.4, 1.0]);
        assert_eq!(profile.projector.response, Some(table));
        for (response, found) in [
            (
                "{ gamma = 2, table = [0, 1] }",
                "projector.response: `gamma` and `table`; expected exactly one of `gamma`, `table`",
            ),
            ("{}", "projector.response: an empty table; expected exactly"),
            (
                "2.2",
                "projector.response: a number; expected exactly one of",
            ),
        ] {
            let text = format!("{LEAST}response = {response}\n");
            let message = Profile::parse(&text, "own.toml").unwrap_err().to_string();
            assert!(message.contains(found), "{message}");
        }
    }

    #[test]
    fn errors_name_what_the_user_wrote() {
        let errors = |text: &str| Profile::parse(text, "m.toml").unwrap_err().to_string();
        // The errors mention neither the gain nor the model, because the gain follows from the full well
        // and the model from the name.
        let text = format!("{LEAST}[camera.sensor]\nfull_well_e = 0\n").replace("least", "a,b");
        let message = errors(&text);
        assert_eq!(message.lines().count(), 2, "{message}");
        assert!(message.starts_with("m.toml:1: name: \"a,b\";"), "{message}");
        assert!(
            message.contains("m.toml:13: camera.sensor.full_well_e: 0;"),
            "{message}"
        );
        let message = errors(&format!("{LEAST}[camera.sensor]\ngain_dn_per_e = nan\n"));
        assert!(
            message.contains("camera.sensor.gain_dn_per_e: NaN;"),
            "{message}"
        );
        let message = errors(&format!("{LEAST}[camera.sensor]\nbits = 12\n"));
        let expected = "expected 8 for camera.format = GREY, the default";
        assert!(message.contains(expected), "{message}");
        let text = LEAST.replace("[projector]", "exposure_range_us = [20, 5000]\n[projector]");
        assert_eq!(
            errors(&text),
            "m.toml:2: camera.exposure_us: 10000, the default; expected 20 to 5000 for \
             camera.exposure_range_us = [20, 5000]"
        );
        // The default sequences have the period of free-running frames.
        let timing =
            "[projector.timing]\nmin_exposure_us = [7, 7, 7, 7, 7, 7, 7, 7]\nresolution_us = 7\n";
        let message = errors(&format!("{LEAST}{timing}"));
        assert!(
            message
                .contains("camera.frame_interval_us: 33333, the default; expected whole multiples"),
            "{message}"
        );
    }

    #[test]
    fn missing_names_hide_no_other_error() {
        let text = LEAST
            .replace("name = \"least\"\n", "")
            .replace("throw_ratio = 1.4", "throw_ratio = -1");
        let message = Profile::parse(&text, "m.toml").unwrap_err().to_string();
        let expected = [
            "m.toml:1: missing field `name`; expected the required field `name`",
            "m.toml:9: projector.throw_ratio: -1; expected 0.05 to 100",
        ];
        assert_eq!(message.lines().collect::<Vec<_>>(), expected);
    }

    #[test]
    fn many_patterns_are_refused_before_they_are_expanded() {
        let set =
            "{ pattern = { kind = \"fringe-set\", axis = \"x\", period_px = 16, steps = 128 } },";
        let text = format!(
            "sequence = [{{ name = \"a\", period_us = 40000, frame = [{}] }}]\n{LEAST}",
            set.repeat(50_000)
        );
        let message = Profile::parse(&text, "m.toml").unwrap_err().to_string();
        let expected =
            "m.toml:1: sequence[0].frame: more than 4096 frames; expected 1 to 4096 frames";
        assert_eq!(message, expected);
        let sequence = "[[sequence]]\nname = \"a\"\nperiod_us = 1\nframe = []\n";
        let text = format!("{LEAST}{}", sequence.repeat(65));
        let message = Profile::parse(&text, "m.toml").unwrap_err().to_string();
        assert!(
            message.contains("sequence: a list of more than 64; expected at most 64"),
            "{message}"
        );
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
