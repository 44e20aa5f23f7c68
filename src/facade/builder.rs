//! Builds an emulated device from a profile, a scene, options and faults.

use super::Device;
use phasmid_core::Stop;
use phasmid_core::error::{Error, Result};
use phasmid_device::UserSequence;
use phasmid_profile::{Profile, Scene, Setting, Settings};
use phasmid_protocol::dialect::Dialect;
use phasmid_protocol::faults::{Fault, Schedule};
use phasmid_render::{Backend, Options};
use std::fmt::Display;
use std::path::PathBuf;

/// The profile of a device: a built-in name, the path of a TOML file, or a [`Profile`].
#[derive(Debug, Clone)]
pub struct ProfileSource(Source<Profile>);

/// The scene in front of a device: a built-in name, the path of a TOML file, or a [`Scene`].
#[derive(Debug, Clone)]
pub struct SceneSource(Source<Scene>);

#[derive(Debug, Clone)]
enum Source<T> {
    Named(String),
    Given(Box<T>),
}

impl<T> Source<T> {
    fn is_given(&self) -> bool {
        matches!(self, Self::Given(_))
    }

    fn load(self, read: impl FnOnce(&str) -> Result<T>) -> Result<T> {
        match self {
            Self::Named(name) => read(&name),
            Self::Given(given) => Ok(*given),
        }
    }
}

/// Implements the conversions into a source type: from a name or path, and from a profile or scene.
macro_rules! source_of {
    ($source:ident, $given:ident) => {
        impl From<&str> for $source {
            fn from(name_or_path: &str) -> Self {
                Self(Source::Named(name_or_path.to_owned()))
            }
        }

        impl From<String> for $source {
            fn from(name_or_path: String) -> Self {
                Self(Source::Named(name_or_path))
            }
        }

        impl From<$given> for $source {
            fn from(given: $given) -> Self {
                Self(Source::Given(Box::new(given)))
            }
        }
    };
}

source_of!(ProfileSource, Profile);
source_of!(SceneSource, Scene);

/// Builds a [`Device`]. No setter fails; [`Self::build`] reports all errors together.
///
/// ```
/// let wrong = phasmid::Device::builder()
///     .profile("pmp-bensh")
///     .scene("teapot")
///     .build()
///     .err()
///     .expect("neither exists");
/// assert!(wrong.to_string().contains("pmp-bensh") && wrong.to_string().contains("teapot"));
/// ```
#[derive(Debug, Clone)]
#[must_use = "nothing is built before `build`"]
pub struct DeviceBuilder {
    profile: ProfileSource,
    scene: SceneSource,
    seed: u64,
    options: Options,
    noise: Option<bool>,
    exact_calibration: Option<bool>,
    settings: Vec<Setting>,
    dialect: Option<String>,
    sequences: Vec<PathBuf>,
    schedule: Schedule,
    stop: Stop,
}

impl Default for DeviceBuilder {
    /// Returns a builder of the built-in device `pmp-bench` in front of the scene `torso`.
    fn default() -> Self {
        Self {
            profile: "pmp-bench".into(),
            scene: "torso".into(),
            seed: 0,
            options: Options::default(),
            noise: None,
            exact_calibration: None,
            settings: Vec::new(),
            dialect: None,
            sequences: Vec::new(),
            schedule: Schedule::default(),
            stop: Stop::default(),
        }
    }
}

impl Device {
    /// Returns a builder with default settings.
    pub fn builder() -> DeviceBuilder {
        DeviceBuilder::default()
    }
}

impl DeviceBuilder {
    /// Sets the profile; `pmp-bench` by default.
    pub fn profile(mut self, profile: impl Into<ProfileSource>) -> Self {
        self.profile = profile.into();
        self
    }

    /// Sets the scene; `torso` by default.
    pub fn scene(mut self, scene: impl Into<SceneSource>) -> Self {
        self.scene = scene.into();
        self
    }

    /// Overrides a field of the profile or of the scene: `field` is the path of the field, `value`
    /// a TOML value or text.
    ///
    /// ```
    /// # fn main() -> Result<(), phasmid::Error> {
    /// let builder = phasmid::Device::builder().profile("webcam-grey").scene("plane");
    /// let device = builder
    ///     .set("camera.sensor.read_noise_e", 5)
    ///     .set("object[0].position_mm", "[0, 0, 900]")
    ///     .build()?;
    /// assert_eq!(device.profile().camera.sensor.read_noise_e, 5.0);
    /// # Ok(())
    /// # }
    /// ```
    pub fn set(mut self, field: impl Into<String>, value: impl Display) -> Self {
        self.settings.push(Setting::new(field, value));
        self
    }

    /// Sets the seed of the noise; 0 by default. Equal seeds give equal bytes on every machine.
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// Sets where the render passes run; the CPU by default.
    pub fn backend(mut self, backend: Backend) -> Self {
        self.options.backend = backend;
        self
    }

    /// Sets the number of rays per pixel: 1 (default), 4, 16 or 64. More rays resolve details thinner
    /// than a pixel.
    pub fn samples(mut self, samples: u32) -> Self {
        self.options.samples = samples;
        self
    }

    /// Sets the number of points in time per exposure at which a moving scene is rendered: 1 to
    /// 256, 4 by default.
    pub fn time_samples(mut self, time_samples: u32) -> Self {
        self.options.time_samples = time_samples;
        self
    }

    /// Sets the maximum error, 0 to 1 projector pixels, with which the geometry of a moving scene may be
    /// interpolated between points in time, 0.01 by default. With 0, the geometry is traced at every point
    /// in time.
    pub fn motion_tolerance(mut self, pixels: f64) -> Self {
        self.options.motion_tolerance_px = pixels;
        self
    }

    /// Sets whether the sensor has noise; overrides the profile.
    pub fn noise(mut self, noise: bool) -> Self {
        self.noise = Some(noise);
        self
    }

    /// Sets whether the device reports its exact rig (`true`) or a factory calibration with errors
    /// (`false`); overrides the profile.
    pub fn exact_calibration(mut self, exact: bool) -> Self {
        self.exact_calibration = Some(exact);
        self
    }

    /// Sets the dialect of the control port, which replaces the profile's: a built-in name or the path
    /// of a TOML file.
    pub fn dialect(mut self, name_or_path: impl Into<String>) -> Self {
        self.dialect = Some(name_or_path.into());
        self
    }

    /// Stores another sequence in the device, in addition to the profile's sequences. `manifest` is the
    /// path of the sequence's manifest, whose folder also contains the images.
    pub fn sequence(mut self, manifest: impl Into<PathBuf>) -> Self {
        self.sequences.push(manifest.into());
        self
    }

    /// Adds a fault. [`Device::inject`] adds a fault at run time.
    pub fn fault(mut self, fault: Fault) -> Self {
        self.schedule.fault.push(fault);
        self
    }

    /// Replaces the faults, and the seed for faults that occur by chance.
    pub fn faults(mut self, schedule: Schedule) -> Self {
        self.schedule = schedule;
        self
    }

    /// Sets a handle with which another thread ends the preparation of the scene in
    /// [`Self::build`], and later the rendering of the device ([`Device::stop`]).
    pub fn stop(mut self, stop: Stop) -> Self {
        self.stop = stop;
        self
    }

    /// Builds the device and switches it on.
    ///
    /// # Errors
    /// Returns all errors of the profile, the scene, the dialect, the sequence files and the
    /// options together. If each of these is valid, returns an error if they do not fit together or
    /// if a fault is invalid. Returns [`Error::Interrupted`] if the handle of [`Self::stop`] is
    /// asked.
    pub fn build(self) -> Result<Device> {
        let mut wrong = Vec::new();
        let mut keep = |error: Error| wrong.push(error);
        let settings = Settings::new(self.settings).map_err(&mut keep);
        let settings = settings.unwrap_or_default();
        let given = [
            (self.profile.0.is_given(), settings.profile(), "profile"),
            (self.scene.0.is_given(), settings.scene(), "scene"),
        ];
        for (is_given, settings, kind) in given {
            if let Some(setting) = settings.first().filter(|_| is_given) {
                keep(Error::input(
                    format!("set {setting}"),
                    format!("a {kind} that is given as a value"),
                    format!("the {kind}'s name or path, or a change of the value itself"),
                ));
            }
        }
        let load = |name: &str| Profile::load_with(name, &settings);
        let profile = self.profile.0.load(load).map_err(&mut keep).ok();
        let load = |name: &str| Scene::load_with(name, &settings);
        let scene = self.scene.0.load(load).map_err(&mut keep).ok();
        let dialect = self.dialect.as_deref().map(Dialect::load).transpose();
        let dialect = dialect.map_err(&mut keep).ok().flatten();
        let sequences = self.sequences.iter().filter_map(|path| {
            let sequence = UserSequence::read(path);
            sequence.map_err(&mut keep).ok()
        });
        let sequences = sequences.collect();
        let options = self.options.checked().map_err(&mut keep).ok();
        let (Some(mut profile), Some(scene), Some(options), true) =
            (profile, scene, options, wrong.is_empty())
        else {
            return Err(Error::several(wrong));
        };
        if let Some(noise) = self.noise {
            profile.camera.sensor.noiseless = !noise;
        }
        if let Some(exact) = self.exact_calibration {
            profile.factory_calibration.exact = exact;
        }
        if let Some(name) = &self.dialect {
            // A path is relative to the working directory, not to the profile.
            profile.control.dialect = Dialect::from_anywhere(name);
        }
        let builder = phasmid_device::Device::builder(&profile, &scene)
            .seed(self.seed)
            .options(options)
            .stop(self.stop)
            .sequences(sequences)
            .faults(&self.schedule);
        let builder = match dialect {
            Some(dialect) => builder.dialect(dialect),
            None => builder,
        };
        Ok(Device::new(builder.build()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn building_ends_when_asked() {
        let stop = Stop::default();
        stop.ask();
        let builder = DeviceBuilder::default().scene("torso").stop(stop);
        assert!(matches!(builder.build(), Err(Error::Interrupted)));
    }

    #[test]
    fn settings_of_a_profile_given_as_a_value_are_refused() {
        let profile = Profile::load("webcam-grey").unwrap();
        let builder = DeviceBuilder::default().profile(profile);
        let refused = builder
            .set("camera.max_gain_db", 3)
            .set("light[0].depth", 1)
            .build();
        let message = refused.err().unwrap().to_string();
        assert!(
            message.contains("camera.max_gain_db=3: a profile that is given as a value"),
            "{message}"
        );
        // The error of the scene is reported together with the others: the built-in scene has no
        // `light[0]`.
        assert!(message.contains("light[0].depth=1"), "{message}");
    }
}
