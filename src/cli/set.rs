//! `--set`, fields of the profile and of the scene.

use phasmid_core::error::{Error, Result};
use phasmid_profile::{Profile, Scene, Setting, Settings};

/// Options that set single fields.
#[derive(Debug, clap::Args)]
pub(super) struct SetArgs {
    /// Set a field of the profile or of the scene, such as camera.sensor.read_noise_e=5 or
    /// object[0].albedo=0.4; the value is TOML, or text. May be repeated
    #[arg(long, value_name = "FIELD=VALUE")]
    set: Vec<String>,
}

impl SetArgs {
    /// Returns whether there are any.
    pub(super) fn is_some(&self) -> bool {
        !self.set.is_empty()
    }

    /// Returns the settings.
    ///
    /// # Errors
    /// Returns an error if an option has no value or names no section of a profile or a scene.
    pub(super) fn settings(&self) -> Result<Settings> {
        let settings = self.set.iter().map(|text| {
            let setting = text.parse::<Setting>().map_err(|e| e.at("--set"))?;
            Ok(setting.given_by("--set"))
        });
        Settings::new(settings.collect::<Result<Vec<_>>>()?)
    }

    /// Returns the settings of a profile, for commands without a scene.
    ///
    /// # Errors
    /// Returns an error as [`Self::settings`] does, or if an option sets a field of a scene.
    pub(super) fn of_profile(&self) -> Result<Settings> {
        self.settings()?.only_profile()
    }

    /// Returns the settings of a scene, for commands without a profile.
    ///
    /// # Errors
    /// Returns an error as [`Self::settings`] does, or if an option sets a field of a profile.
    pub(super) fn of_scene(&self) -> Result<Settings> {
        let settings = self.settings()?;
        match settings.profile().first() {
            None => Ok(settings),
            Some(setting) => Err(Error::input(
                format!("--set {setting}"),
                "a field of a profile, which is not used here",
                "a field of a scene, such as object[0].albedo",
            )),
        }
    }

    /// Rejects all settings, for input without fields to set; `found` says which.
    ///
    /// # Errors
    /// Returns an error that names the first option.
    pub(super) fn refuse(&self, found: &str) -> Result<()> {
        match self.set.first() {
            None => Ok(()),
            Some(setting) => Err(Error::input(
                format!("--set {setting}"),
                found,
                "a profile or a scene, or no --set",
            )),
        }
    }

    /// Loads a profile and a scene, with the settings.
    ///
    /// # Errors
    /// Returns all that is wrong with both.
    pub(super) fn load(&self, profile: &str, scene: &str) -> Result<(Profile, Scene)> {
        let settings = self.settings()?;
        let profile = Profile::load_with(profile, &settings);
        match (profile, Scene::load_with(scene, &settings)) {
            (Ok(profile), Ok(scene)) => Ok((profile, scene)),
            (profile, scene) => {
                let errors = profile.err().into_iter().chain(scene.err());
                Err(Error::several(errors.collect()))
            }
        }
    }
}
