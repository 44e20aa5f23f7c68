//! Camera settings that a host changes without the control port, through the controls of a USB
//! camera. Commands change the same settings, but reject values out of range instead of clamping
//! them.

use super::settings::Settings;
use super::{Firmware, State};
use phasmid_protocol::PixelFormat;

/// The camera settings that a host can read and change through camera controls.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraControls {
    /// Exposure in nanoseconds.
    pub exposure_ns: u64,
    /// Gain in decibels.
    pub gain_db: f64,
}

impl Firmware {
    /// Returns the current camera settings.
    pub fn camera_controls(&self) -> CameraControls {
        CameraControls {
            exposure_ns: self.settings.exposure_ns,
            gain_db: self.settings.gain_db,
        }
    }

    /// Sets exposure and gain, each clamped to its range. Returns `false` and changes nothing while
    /// a sequence is being exposed or if the exposure would exceed the sequence's period.
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

    /// Returns the longest exposure that [`Self::set_camera_controls`] would accept now, or `None`
    /// while it accepts none.
    pub fn settable_exposure_ns(&self) -> Option<u64> {
        let running = matches!(self.state, State::Running { .. });
        let room_ns = self.settings.period_ns;
        (!running).then_some(room_ns.saturating_sub(self.settings.readout_ns()))
    }

    /// Sets the pixel format and frame interval that a host negotiated. Returns `false` and changes
    /// nothing while a sequence is being exposed or if the sensor does not support the format.
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
