//! Execution of commands and queries, with one file for each subsystem of the device.

mod camera;
mod common;
mod form;
mod projector;
mod sequence;
mod setting;
mod trigger;

use super::settings::{Settings, seconds};
use super::table::{Command, find};
use super::{Firmware, State};
use phasmid_profile::Timing;
use phasmid_protocol::scpi::{DeviceError, ErrorCode, Unit};

/// Maximum of all settable times in seconds.
const MAX_TIME_S: f64 = 60.0;

type Answer = Result<Option<Vec<u8>>, DeviceError>;

/// Formats the answer of a query.
fn say(value: impl std::fmt::Display) -> Answer {
    Ok(Some(value.to_string().into_bytes()))
}

impl Firmware {
    /// Executes one unit.
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

    /// `*RST`. If the attached link cannot carry the power-on format, region and pixel format are
    /// kept.
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

/// Rejects settings whose exposures do not fit a period, and, for a projector with timing, settings
/// with which it cannot show patterns that take at least `shortest_ns`.
fn check_period(
    settings: &Settings,
    period_ns: u64,
    timing: Option<&Timing>,
    shortest_ns: u64,
) -> Result<(), DeviceError> {
    let period_s = seconds(period_ns);
    let shown = timing.and_then(|timing| {
        let pattern_ns = settings.pattern_ns(timing, period_ns);
        timing.conflict(period_ns, pattern_ns, shortest_ns)
    });
    let conflict = if settings.exposure_ns > period_ns {
        format!(
            "exposure {} s exceeds the sequence's period {period_s} s",
            seconds(settings.exposure_ns)
        )
    } else if settings.shutter().readout_ns() > period_ns {
        format!(
            "{} rows are read in {} s, which exceeds the sequence's period {period_s} s",
            settings.roi.height,
            seconds(settings.shutter().readout_ns())
        )
    } else if settings.shortest_period_ns() > period_ns {
        format!(
            "a frame takes {} s until the camera is ready for the next one, which exceeds the \
             sequence's period {period_s} s",
            seconds(settings.shortest_period_ns())
        )
    } else if let Some((found, allowed)) = shown {
        format!("{found}, allowed {allowed}")
    } else {
        return Ok(());
    };
    Err(ErrorCode::SettingsConflict.with(conflict))
}

/// Returns whether the profile's exposure fits the profile's period.
pub(super) fn power_on_is_consistent(profile: &phasmid_profile::Profile) -> bool {
    let settings = Settings::reset(profile);
    let projector = &profile.projector;
    let timing = projector.timing.as_ref();
    let patterns = profile.sequence[0].frame.iter().map(|f| &f.pattern);
    let shortest_ns = timing.map_or(0, |t| t.shortest_exposure_ns(patterns, projector.bits));
    check_period(&settings, settings.period_ns, timing, shortest_ns).is_ok()
}
