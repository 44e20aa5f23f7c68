//! Execution of commands and queries, with one file for each subsystem of the device.

mod camera;
mod common;
mod form;
mod projector;
mod sequence;
mod trigger;

use super::settings::{Settings, check_period};
use super::table::{Command, find};
use super::{Firmware, State};
use phasmid_protocol::scpi::{DeviceError, ErrorCode, Unit};

/// Maximum of all settable times in seconds.
const MAX_TIME_S: f64 = 60.0;

type Answer = Result<Option<Vec<u8>>, DeviceError>;

/// Formats the answer of a query.
fn say(value: impl std::fmt::Display) -> Answer {
    Ok(Some(value.to_string().into_bytes()))
}

impl Firmware {
    /// Executes one unit, a command or query with its parameters.
    pub(super) fn execute(&mut self, unit: &Unit) -> Answer {
        let command = find(unit)?;
        self.check_form(unit, command)?;
        match command {
            Command::Exposure
            | Command::Gain
            | Command::Format
            | Command::Roi
            | Command::Interval => self.camera(unit, command),
            Command::Lamp | Command::Current | Command::Shown | Command::PatternExposure => {
                self.projector(unit, command)
            }
            Command::Select
            | Command::List
            | Command::Count
            | Command::Period
            | Command::Data
            | Command::Image
            | Command::DeleteImage
            | Command::Define
            | Command::Delete => self.sequence(unit, command),
            Command::Trigger
            | Command::BusTrigger
            | Command::Source
            | Command::Delay
            | Command::Mode
            | Command::Missed
            | Command::Initiate
            | Command::Continuous
            | Command::Abort => self.trigger_system(unit, command),
            _ => self.common(unit, command),
        }
    }

    fn not_running(&self) -> Result<(), DeviceError> {
        match self.state {
            State::Running { .. } => {
                Err(ErrorCode::SettingsConflict.with("a sequence is being exposed"))
            }
            _ => Ok(()),
        }
    }

    fn not_initiated(&self) -> Result<(), DeviceError> {
        if self.state.initiated() {
            return Err(ErrorCode::SettingsConflict
                .with("initiated, ABORt first (INITiate:CONTinuous OFF before that)"));
        }
        Ok(())
    }

    /// Executes `*RST`. If the attached link cannot carry the power-on format, region and pixel
    /// format are kept.
    pub(super) fn reset(&mut self) -> Result<(), DeviceError> {
        let settings = Settings::reset(&self.profile);
        let (roi, format) = (self.settings.roi, self.settings.format);
        let mut done = self.apply(settings.clone());
        if done.is_err() {
            let kept = Settings {
                roi,
                format,
                ..settings
            };
            done = done.and(self.apply(kept.clone()));
            self.settings = kept;
        }
        let first = self.memory.first().clone();
        self.select(first);
        self.missed = 0;
        self.completion_asked = false;
        self.rest();
        done
    }

    /// Rejects settings with which the selected sequence cannot be exposed.
    fn check_selected(&self, settings: &Settings) -> Result<(), DeviceError> {
        let timing = self.profile.projector.timing.as_ref();
        let shortest_ns = self.selected.shortest_ns;
        check_period(settings, settings.period_ns, timing, shortest_ns)
    }

    /// Rounds a time to the resolution of the projector's clock.
    fn quantised(&self, ns: u64) -> u64 {
        let timing = self.profile.projector.timing.as_ref();
        timing.map_or(ns, |timing| timing.quantise_ns(ns))
    }

    pub(super) fn sequence_len(&self) -> u32 {
        self.selected.pattern_images.len() as u32
    }
}
