//! Options that several commands share: `--set`, fields of the profile and of the scene; `--backend`, where
//! the render passes run; and options with three numbers.

use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_profile::{Profile, Scene, Setting, Settings};
use phasmid_render::Backend;
use std::fmt;

/// Options that set single fields.
#[derive(Debug, clap::Args)]
pub(super) struct SetArgs {
    /// Set a field of the profile or of the scene, such as camera.sensor.read_noise_e=5 or
    /// object[0].albedo=0.4; the value is TOML, or text. May be repeated
    #[arg(long, value_name = "FIELD=VALUE")]
    set: Vec<String>,
}

impl SetArgs {
    /// Returns whether any field is set.
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

    /// Rejects all settings, for input without fields to set; `found` names that input.
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

    /// Loads a profile and a scene, and applies the settings to them.
    ///
    /// # Errors
    /// Returns the errors of both files together.
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

/// Values of `--backend`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum BackendArg {
    /// The CPU; equal seeds give equal bytes on every machine
    Cpu,
    /// A Vulkan adapter, preferably a hardware adapter; fails if there is none
    Gpu,
    /// A hardware Vulkan adapter if there is one that can hold the scene, else the CPU
    Auto,
}

impl From<BackendArg> for Backend {
    fn from(choice: BackendArg) -> Self {
        match choice {
            BackendArg::Cpu => Self::Cpu,
            BackendArg::Gpu => Self::Gpu,
            BackendArg::Auto => Self::Auto,
        }
    }
}

impl fmt::Display for BackendArg {
    /// Writes the value as spelled on the command line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
            Self::Auto => "auto",
        })
    }
}

/// Parses `X,Y,Z`, three numbers with a magnitude of at most `most`; `allowed` describes the valid
/// input in messages.
///
/// # Errors
/// Returns an error if the text is not three numbers within the limit.
pub(super) fn vector(option: &str, text: &str, most: f64, allowed: &str) -> Result<DVec3> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) if [x, y, z].iter().all(|n| n.abs() <= most) => Ok(DVec3::new(x, y, z)),
        found => Err(Error::input(
            format!("{option} {text}"),
            match found {
                Some([_, _, _]) => format!("numbers beyond {most}"),
                _ => "not three numbers".to_owned(),
            },
            allowed,
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_three_numbers_and_refuses_anything_else() {
        let read = |text| vector("--at", text, 1e5, "X,Y,Z in millimetres, as 1,2,3");
        assert_eq!(
            read("-12.5, 140,-812").unwrap(),
            DVec3::new(-12.5, 140.0, -812.0)
        );
        for (text, found) in [
            (
                "1,2",
                "--at 1,2: not three numbers; expected X,Y,Z in millimetres, as 1,2,3",
            ),
            ("1,2,x", "not three numbers"),
            ("1,2,3,4", "not three numbers"),
            ("1,NaN,3", "numbers beyond 100000"),
            ("1,2,1e6", "numbers beyond 100000"),
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains(found), "{error}");
        }
    }
}
