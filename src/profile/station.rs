//! Station: several devices that observe one scene. `phasmid serve --profile` treats a file with
//! `[[device]]` as a station and any other as a device profile.

use super::device::check_identity;
use super::object::{POSITION_MM, ROTATION_DEG};
use super::{Profile, RigPlace, Settings, TomlSource, builtin, profile_names, scene_names};
use phasmid_core::check::{Check, name};
use phasmid_core::error::Result;
use phasmid_protocol::dialect::Dialect;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Maximum number of devices in a station or a server.
pub const MAX_DEVICES: usize = 64;

/// Several devices that observe one scene, as accepted by `phasmid serve --profile`:
///
/// ```toml
/// name = "two-pods"
/// description = "Two scanners that look at one torso"
/// scene = "torso"                      # a built-in name, or a file relative to this one
///
/// [[device]]
/// name = "left"                        # also names its run directory
/// profile = "webcam-grey"              # a built-in name, or a file relative to this one
/// position_mm = [0.0, -500.0, 50.0]    # pose of its rig in the scene; replaces
/// rotation_deg = [-27.8, 0.0, 0.0]     # the scene's [rig]
/// seed = 1                             # seed of its noise
/// dialect = "scpi"                     # dialect of its control port; replaces the profile's
/// ```
///
/// Devices of a station share scene and clock. A camera sees only the light of its own device's
/// projector: devices that expose at the same time are assumed to separate their light.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Station {
    /// Name used to select the station.
    pub name: String,
    /// One line for listings.
    #[serde(default)]
    pub description: String,
    /// Scene: a built-in name, or a file relative to this one.
    #[serde(default)]
    pub scene: Option<String>,
    /// The devices.
    pub device: Vec<StationDevice>,
    /// Folder of the station file, to which file paths are relative.
    #[serde(skip)]
    pub folder: PathBuf,
}

/// A device of a station.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct StationDevice {
    /// Name, unique within the station.
    pub name: String,
    /// Profile: a built-in name, or a file relative to the station's.
    pub profile: String,
    /// Position of the camera's pupil in the scene's frame in millimetres. If both this and the
    /// rotation are absent, the scene's rig pose applies.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly_if_any")]
    pub position_mm: Option<[f64; 3]>,
    /// Rotation in degrees about the scene's fixed x, then y, then z axis.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly_if_any")]
    pub rotation_deg: Option<[f64; 3]>,
    /// Dialect of the control port, overriding the profile's: a built-in name, or a file relative
    /// to the station's.
    #[serde(default)]
    pub dialect: Option<String>,
    /// Serial number, overriding the profile's. It determines the errors of the factory calibration,
    /// so each device of a kind should have its own.
    #[serde(default)]
    pub serial: Option<String>,
    /// Noise seed, to which the command-line seed is added; derived from the device's index when
    /// absent.
    #[serde(default)]
    pub seed: Option<u64>,
    /// Source location of the dialect, for messages.
    #[serde(skip)]
    pub dialect_place: String,
}

/// A device profile or a station.
#[derive(Debug, Clone, PartialEq)]
pub enum Configuration {
    /// One device.
    Device(Box<Profile>),
    /// Several devices.
    Station(Station),
}

impl Configuration {
    /// Loads a built-in profile or station by its name, or else a file by its path.
    ///
    /// # Errors
    /// Returns an error if the name is neither built in nor a file, if the file cannot be read, or
    /// if [`Profile::parse`] or [`Station::parse`] fails.
    pub fn load(name_or_path: &str) -> Result<Self> {
        Self::load_with(name_or_path, &Settings::default())
    }

    /// Loads a profile or a station as [`Self::load`] does. The settings are applied to a profile. For a
    /// station they are not applied here: they concern its devices' profiles and its scene, which are
    /// loaded later.
    ///
    /// # Errors
    /// Returns an error as [`Self::load`] does, or if a setting names no field or an invalid value.
    pub fn load_with(name_or_path: &str, settings: &Settings) -> Result<Self> {
        let (source, folder) = builtin::configuration_source(name_or_path)?;
        Ok(if source.has("device") {
            Self::Station(Station {
                folder,
                ..Station::from_source(&source)?
            })
        } else {
            Self::Device(Box::new(Profile {
                folder,
                ..Profile::from_source(&source.with(&settings.profile))?
            }))
        })
    }
}

impl Configuration {
    /// Returns the TOML text of a profile or a station exactly as in its file.
    ///
    /// # Errors
    /// Returns an error as [`Self::load`] does.
    pub fn text(name_or_path: &str) -> Result<String> {
        Self::load(name_or_path)?;
        let (source, _) = builtin::configuration_source(name_or_path)?;
        Ok(source.text().to_owned())
    }

    /// Returns the TOML of a profile or a station, merged with the documents that it extends and with
    /// settings, without comments.
    ///
    /// # Errors
    /// Returns an error as [`Self::load_with`] does.
    pub fn full_text(name_or_path: &str, settings: &Settings) -> Result<String> {
        Self::load_with(name_or_path, settings)?;
        let (source, _) = builtin::configuration_source(name_or_path)?;
        source.with(&settings.profile).to_toml()
    }
}

impl Station {
    /// Parses and checks a station; `place` is the file name used in messages.
    ///
    /// # Errors
    /// Returns an error with its line on a syntax error, an unknown field, a wrong type or an
    /// invalid value.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        Self::from_source(&TomlSource::new(text, place))
    }

    fn from_source(source: &TomlSource) -> Result<Self> {
        Check::read(source, |station: &mut Self, all| {
            for (at, device) in station.device.iter_mut().enumerate() {
                device.dialect_place = source.place_of(&format!("device[{at}].dialect"));
            }
            check(station, all)
        })
    }

    /// Returns the scene as [`Scene::load`](super::Scene::load) expects it.
    pub fn scene(&self) -> Option<String> {
        let scene = self.scene.as_deref()?;
        let built_in = scene_names().any(|name| name == scene);
        Some(self.resolve(scene, built_in))
    }

    /// Returns a device's profile as [`Profile::load`] expects it.
    pub fn profile(&self, device: &StationDevice) -> String {
        let built_in = profile_names().any(|name| name == device.profile);
        self.resolve(&device.profile, built_in)
    }

    /// Returns a device's dialect, if it sets one.
    pub fn dialect(&self, device: &StationDevice) -> Option<String> {
        let dialect = device.dialect.as_deref()?;
        let built_in = Dialect::names().any(|name| name == dialect);
        Some(self.resolve(dialect, built_in))
    }

    fn resolve(&self, name_or_path: &str, built_in: bool) -> String {
        match built_in || Path::new(name_or_path).is_absolute() {
            true => name_or_path.to_owned(),
            false => self.folder.join(name_or_path).display().to_string(),
        }
    }
}

impl StationDevice {
    /// Returns the pose of the device's rig in the scene, if the station states it.
    pub fn rig(&self) -> Option<RigPlace> {
        (self.position_mm.is_some() || self.rotation_deg.is_some()).then(|| RigPlace {
            position_mm: self.position_mm.unwrap_or_default(),
            rotation_deg: self.rotation_deg.unwrap_or_default(),
        })
    }
}

fn check(s: &Station, check: &Check<'_>) -> Result<()> {
    check.section(|check| name(&s.name, "name", check));
    check.that(
        (1..=MAX_DEVICES).contains(&s.device.len()),
        "device",
        format!("{} devices", s.device.len()),
        format!("1 to {MAX_DEVICES} devices"),
    )?;
    for i in 0..s.device.len() {
        check.section(|check| check_device(s, i, check));
    }
    Ok(())
}

fn check_device(s: &Station, i: usize, check: &Check<'_>) -> Result<()> {
    let device = &s.device[i];
    let field = |name: &str| format!("device[{i}].{name}");
    if let Some(serial) = &device.serial {
        check_identity(serial, &field("serial"), check)?;
    }
    name(&device.name, &field("name"), check)?;
    // A device's name is also the name of its run directory, so it must not begin with a dot.
    check.that(
        !device.name.starts_with('.'),
        &field("name"),
        format!("{:?}", device.name),
        "a name that does not begin with '.'",
    )?;
    let first = s.device.iter().position(|other| other.name == device.name);
    check.that(
        first == Some(i),
        &field("name"),
        format!("{:?}, which is already used", device.name),
        "a unique name",
    )?;
    let (position, rotation) = (device.position_mm, device.rotation_deg);
    check.all_within(
        &field("position_mm"),
        &position.unwrap_or_default(),
        POSITION_MM,
    )?;
    check.all_within(
        &field("rotation_deg"),
        &rotation.unwrap_or_default(),
        ROTATION_DEG,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Scene, station_names};

    const TEXT: &str = "name = \"s\"\ndescription = \"\"\nscene = \"mine.toml\"\n\
        [[device]]\nname = \"a\"\nprofile = \"webcam-grey\"\nseed = 7\n\
        [[device]]\nname = \"b\"\nprofile = \"pods/b.toml\"\nrotation_deg = [0.0, 9.0, 0.0]\n";

    #[test]
    fn built_in_stations_and_profiles_load() {
        for name in station_names() {
            let Configuration::Station(station) = Configuration::load(name).unwrap() else {
                panic!("{name} is a device");
            };
            assert_eq!(station.name, name);
            Scene::load(&station.scene().unwrap()).unwrap();
            for device in &station.device {
                Profile::load(&station.profile(device)).unwrap();
                // Devices with equal serial numbers would have equal errors of the factory
                // calibration.
                let of = |serial: &Option<String>| serial == &device.serial;
                let count = station.device.iter().filter(|d| of(&d.serial)).count();
                assert!(device.serial.is_some() && count == 1, "{name}");
            }
        }
        for name in profile_names() {
            let Configuration::Device(profile) = Configuration::load(name).unwrap() else {
                panic!("{name} is a station");
            };
            assert_eq!(*profile, Profile::load(name).unwrap());
        }
        let unknown = Configuration::load("no-such").unwrap_err().to_string();
        assert!(
            unknown.contains("webcam-grey, two-pods, sgrt-ceiling or the path"),
            "{unknown}"
        );
    }

    #[test]
    fn station_resolves_files_and_places_rigs() {
        let mut station = Station::parse(TEXT, "test").unwrap();
        station.folder = PathBuf::from("/desk");
        assert_eq!(station.scene().as_deref(), Some("/desk/mine.toml"));
        let [a, b] = &station.device[..] else {
            panic!("two devices");
        };
        assert_eq!(station.profile(a), "webcam-grey");
        assert_eq!(station.profile(b), "/desk/pods/b.toml");
        assert_eq!((a.rig(), a.seed), (None, Some(7)));
        assert_eq!(b.rig().unwrap().rotation_deg, [0.0, 9.0, 0.0]);
    }

    #[test]
    fn impossible_stations_are_refused_with_line_and_range() {
        for (from, to, needles) in [
            (
                "name = \"b\"",
                "name = \"a\"",
                ["test:9: device[1].name", "already used"],
            ),
            (
                "name = \"b\"",
                "name = \"..\"",
                ["device[1].name", "begin with '.'"],
            ),
            (
                "name = \"b\"",
                "name = \"b/c\"",
                ["device[1].name", "letters"],
            ),
            ("9.0", "400.0", ["device[1].rotation_deg", "-360 to 360"]),
            (
                "seed = 7",
                "seed = 7\nserial = \"1,2\"",
                ["device[0].serial", "without comma"],
            ),
            ("seed = 7", "speed = 7", ["test:7", "unknown field `speed`"]),
            (
                "profile = \"webcam-grey\"",
                "",
                [
                    "test:4",
                    "missing field `profile`; expected the required field `profile`",
                ],
            ),
        ] {
            let text = TEXT.replacen(from, to, 1);
            let words = Station::parse(&text, "test").unwrap_err().to_string();
            assert!(needles.iter().all(|n| words.contains(n)), "{words}");
        }
        let empty = "name = \"s\"\ndescription = \"\"\ndevice = []\n";
        let words = Station::parse(empty, "test").unwrap_err().to_string();
        assert!(words.contains("0 devices, allowed: 1 to 64") || words.contains("1 to 64"));
    }
}
