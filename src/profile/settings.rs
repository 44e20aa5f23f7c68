//! Settings that override fields of a profile or a scene, as `--set` gives them.

use phasmid_core::error::{Error, Result};
use phasmid_core::source::Setting;
use phasmid_core::wording::nearest;

/// Sections of a profile that can be set.
const PROFILE: [&str; 8] = [
    "identity",
    "camera",
    "projector",
    "usb",
    "control",
    "calibration",
    "factory_calibration",
    "sequence",
];
/// Sections of a scene that can be set.
const SCENE: [&str; 5] = ["rig", "ambient", "light", "interreflection", "object"];

/// Settings of a profile and of a scene. The first key of a setting selects the document, because
/// profiles and scenes have no first key in common.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Settings {
    pub(super) profile: Vec<Setting>,
    pub(super) scene: Vec<Setting>,
}

impl Settings {
    /// Sorts settings into those for a profile and those for a scene.
    ///
    /// # Errors
    /// Returns an error if the first key of a setting is neither a section of a profile nor of a scene.
    pub fn new(settings: impl IntoIterator<Item = Setting>) -> Result<Self> {
        let mut sorted = Self::default();
        for setting in settings {
            let section = setting.section();
            if PROFILE.contains(&section) {
                sorted.profile.push(setting);
            } else if SCENE.contains(&section) {
                sorted.scene.push(setting);
            } else {
                let known = [&PROFILE[..], &SCENE].concat();
                let similar = nearest(section, known.iter().copied());
                let hint =
                    similar.map_or_else(String::new, |name| format!(" (did you mean {name}?)"));
                return Err(Error::input(
                    setting.place(),
                    format!("{section:?}{hint}"),
                    format!("a field of {}", known.join(", ")),
                ));
            }
        }
        Ok(sorted)
    }

    /// Returns the settings for the profile.
    pub fn profile(&self) -> &[Setting] {
        &self.profile
    }

    /// Returns the settings for the scene.
    pub fn scene(&self) -> &[Setting] {
        &self.scene
    }

    /// Returns an error if there are settings of a scene, for commands without a scene.
    ///
    /// # Errors
    /// Returns an error that names the first such setting.
    pub fn only_profile(self) -> Result<Self> {
        match self.scene.first() {
            None => Ok(self),
            Some(setting) => Err(Error::input(
                setting.place(),
                "a field of a scene, which is not used here",
                format!("a field of {}", PROFILE.join(", ")),
            )),
        }
    }
}
