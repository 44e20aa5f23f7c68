//! What a host sets past the control port: the controls of a camera on USB. They are the settings
//! that the commands set, with the same rules.

use super::settings::Settings;
use super::{Firmware, State};
use phasmid_protocol::PixelFormat;

/// The camera's settings that a host can see and set beside the commands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraControls {
    /// Exposure in nanoseconds.
    pub exposure_ns: u64,
    /// Gain in decibels.
    pub gain_db: f64,
}

impl Firmware {
    /// How the camera is set.
    pub fn camera_controls(&self) -> CameraControls {
        CameraControls {
            exposure_ns: self.settings.exposure_ns,
            gain_db: self.settings.gain_db,
        }
    }

    /// Sets exposure and gain, each held to its range; `false`, and all is as before, while a
    /// sequence is exposed or when the exposure would exceed the sequence's period.
    pub fn set_camera_controls(&mut self, controls: CameraControls) -> bool {
        let [shortest, longest] = self.profile.camera.exposure_range_us;
        let ns = |us: f64| (us * 1e3).round() as u64;
        let exposure_ns = controls.exposure_ns.clamp(ns(shortest), ns(longest));
        if self
            .settable_exposure_ns()
            .is_none_or(|longest| exposure_ns > longest)
        {
            return false;
        }
        self.settings.exposure_ns = exposure_ns;
        let most = self.profile.camera.max_gain_db;
        self.settings.gain_db = controls.gain_db.clamp(0.0, most);
        true
    }

    /// Longest exposure that [`Self::set_camera_controls`] would take now; `None` while it takes
    /// nothing.
    pub fn settable_exposure_ns(&self) -> Option<u64> {
        let running = matches!(self.state, State::Running { .. });
        let room_ns = self.settings.period_ns;
        (!running).then_some(room_ns.saturating_sub(self.settings.readout_ns()))
    }

    /// Sets format and interval of a stream that a host has agreed on; `false`, and all is as
    /// before, while a sequence is exposed or when the sensor has no such format.
    pub fn set_stream(&mut self, format: PixelFormat, interval_ns: u64) -> bool {
        let known = self.profile.camera.sensor.formats().contains(&format);
        if matches!(self.state, State::Running { .. }) || !known {
            return false;
        }
        self.settings = Settings {
            format,
            interval_ns,
            ..self.settings.clone()
        };
        true
    }
}
