//! Assembles a device from a profile and a scene: for the server, the studies and the tests.

use super::faults::Faults;
use super::port::Port;
use super::{Firmware, Machine, Renderer, SerialLine, UserSequence};
use phasmid_core::Stop;
use phasmid_core::error::{Error, Result};
use phasmid_pattern::Pattern;
use phasmid_profile::{Profile, Scene};
use phasmid_protocol::dialect::Dialect;
use phasmid_protocol::faults::{Flaw, Schedule};
use phasmid_render::Options;
use phasmid_render::shot::Shot;
use std::sync::Arc;

/// An emulated device that is switched on, without links to clients.
pub struct Device {
    /// Firmware, control port, serial line and faults.
    pub machine: Machine,
    /// The optics.
    pub renderer: Renderer,
    /// Profile of the device.
    pub profile: Profile,
    /// The scene in front of the device.
    pub scene: Scene,
    /// Seed of the sensor noise.
    pub seed: u64,
}

impl Device {
    /// Returns a builder for a device with a profile in front of a scene.
    pub fn builder<'a>(profile: &'a Profile, scene: &'a Scene) -> DeviceBuilder<'a> {
        DeviceBuilder {
            profile,
            scene,
            renderer: None,
            name: &profile.name,
            seed: 0,
            options: Options::default(),
            stop: Stop::default(),
            sequences: Vec::new(),
            dialect: None,
            schedule: None,
        }
    }

    /// Returns the exposures of the selected sequence, with their patterns, in order.
    pub fn shots(&self) -> Vec<(Pattern, Shot)> {
        self.machine.firmware().selected_sequence()
    }
}

/// Assembles a [`Device`] from its parts.
#[must_use]
pub struct DeviceBuilder<'a> {
    profile: &'a Profile,
    scene: &'a Scene,
    renderer: Option<Renderer>,
    name: &'a str,
    seed: u64,
    options: Options,
    stop: Stop,
    sequences: Vec<UserSequence>,
    dialect: Option<Dialect>,
    schedule: Option<&'a Schedule>,
}

impl<'a> DeviceBuilder<'a> {
    /// Sets the name by which faults address the device, instead of the profile's.
    pub fn name(self, name: &'a str) -> Self {
        Self { name, ..self }
    }

    /// Sets the seed of the noise; 0 by default.
    pub fn seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// Sets the options with which the optics render.
    pub fn options(self, options: Options) -> Self {
        Self { options, ..self }
    }

    /// Sets the stop request with which another thread can end [`Self::build`] early. The device's
    /// renderer keeps the same request ([`Renderer::stop`]).
    pub fn stop(self, stop: Stop) -> Self {
        Self { stop, ..self }
    }

    /// Uses optics prepared earlier for the same profile and scene. These optics keep their own seed
    /// and options.
    pub fn renderer(self, renderer: Renderer) -> Self {
        Self {
            renderer: Some(renderer),
            ..self
        }
    }

    /// Stores sequences in the device, in addition to the profile's.
    pub fn sequences(self, sequences: Vec<UserSequence>) -> Self {
        Self { sequences, ..self }
    }

    /// Sets the dialect of the control port, instead of the profile's.
    pub fn dialect(self, dialect: Dialect) -> Self {
        Self {
            dialect: Some(dialect),
            ..self
        }
    }

    /// Sets the faults that will occur.
    pub fn faults(self, schedule: &'a Schedule) -> Self {
        Self {
            schedule: Some(schedule),
            ..self
        }
    }

    /// Assembles the device.
    ///
    /// # Errors
    /// Returns an error if the profile, a sequence, the dialect or a fault is invalid, if the scene
    /// cannot be rendered, or if another thread requests a stop through [`Self::stop`].
    pub fn build(self) -> Result<Device> {
        let profile = self.profile;
        let firmware = Firmware::new(profile, &self.sequences)?;
        let dialect = match self.dialect {
            Some(dialect) => dialect,
            None => profile.control.load_dialect(&profile.folder)?,
        };
        let faults = match self.schedule {
            Some(schedule) => Faults::new(schedule, self.name),
            None => Faults::default(),
        };
        let refused = |flaw: Flaw| Error::input(flaw.field, flaw.found, flaw.allowed);
        let schedule = self.schedule.map_or(&[][..], |schedule| &schedule.fault);
        for (number, fault) in schedule.iter().enumerate() {
            let at = |flaw: Flaw| Flaw {
                field: format!("fault[{number}].{}", flaw.field),
                ..flaw
            };
            fault.check().map_err(|flaw| refused(at(flaw)))?;
        }
        let faults = faults.of_rows(profile.camera.height_px).map_err(refused)?;
        let mut renderer = match self.renderer {
            Some(renderer) => renderer,
            None => {
                let (seed, options) = (self.seed, self.options);
                Renderer::with_stop(profile, self.scene, seed, options, self.stop)?
            }
        };
        let shots = firmware.selected_sequence();
        renderer.expect_pattern_images(
            shots
                .iter()
                .filter_map(|(_, shot)| shot.pattern_image.as_deref()),
        );
        let machine = Machine::new(
            firmware,
            Port::new(Arc::new(dialect))?,
            SerialLine::new(&profile.control),
            faults,
        );
        Ok(Device {
            machine,
            renderer,
            profile: profile.clone(),
            scene: self.scene.clone(),
            seed: self.seed,
        })
    }
}
