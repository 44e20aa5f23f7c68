//! Access to the firmware without commands: camera settings for the controls of a USB host, the
//! state that the service channel reports, and snapshots that undo a refused request.
//!
//! A USB control changes the same setting as a command does, but clamps a value out of range instead
//! of rejecting it. A request may consist of several messages. If one of them is refused, the
//! snapshot restores the settings that earlier messages of the request have changed, since a refused
//! request must change nothing.

use super::memory::Stored;
use super::settings::Settings;
use super::{Firmware, State};
use crate::PatternImage;
use phasmid_pattern::Pattern;
use phasmid_protocol::PixelFormat;
use phasmid_protocol::service::Shown;
use phasmid_render::led::Emission;
use std::sync::Arc;

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

impl Firmware {
    /// Returns the number of triggers since power-on or `*RST` that came too early.
    pub fn missed_triggers(&self) -> u64 {
        self.missed
    }

    /// Returns the pattern that a pattern image shows. If several patterns share the pattern image,
    /// prefers the pattern at `index` of the selected sequence, then other patterns of that
    /// sequence.
    pub fn shown(&self, pattern_image: &Arc<PatternImage>, index: Option<u32>) -> Shown {
        for (rest, pattern) in [
            (&self.white, Pattern::White {}),
            (&self.black, Pattern::Black {}),
        ] {
            if Arc::ptr_eq(rest, pattern_image) {
                return Shown {
                    sequence: None,
                    index: None,
                    pattern: Some(pattern),
                };
            }
        }
        let others = self.memory.sequences();
        for stored in std::iter::once(&self.selected).chain(others) {
            let is = |at: &usize| {
                stored
                    .pattern_images
                    .get(*at)
                    .is_some_and(|s| Arc::ptr_eq(s, pattern_image))
            };
            let first = index.into_iter().map(|index| index as usize);
            let mut places = first.chain(0..stored.pattern_images.len());
            if let Some(at) = places.find(is) {
                let frame = stored.manifest.frame.get(at);
                return Shown {
                    sequence: Some(stored.name.clone()),
                    index: Some(at as u32),
                    pattern: frame.map(|frame| frame.pattern.clone()),
                };
            }
        }
        Shown {
            sequence: None,
            index: None,
            pattern: None,
        }
    }
}

/// Snapshot of the settings, the selected sequence and the trigger system.
#[derive(Debug, Clone)]
pub struct Before {
    settings: Settings,
    selected: Arc<Stored>,
    state: State,
    loaded_ns: u64,
    taken_ns: Vec<u64>,
    emitted: Option<Vec<Arc<Emission>>>,
}

impl Firmware {
    /// Returns a snapshot of everything that messages can set.
    pub fn before(&self) -> Before {
        Before {
            settings: self.settings.clone(),
            selected: self.selected.clone(),
            state: self.state,
            loaded_ns: self.loaded_ns,
            taken_ns: self.taken_ns.clone(),
            emitted: self.shining.as_ref().map(|shining| shining.all().to_vec()),
        }
    }

    /// Restores a snapshot. Call at the device time at which the snapshot was taken, so that nothing
    /// has been exposed in between. Counters, cleared registers and the memory keep their present
    /// state.
    pub fn put_back(&mut self, before: Before) {
        let now = self.settings.clone();
        if self.apply(before.settings.clone()).is_err() {
            // A link that cannot change back keeps its format. The request already fails with
            // another error, so this error is not reported.
            self.settings = Settings {
                roi: now.roi,
                format: now.format,
                interval_ns: now.interval_ns,
                ..before.settings
            };
        }
        self.selected = before.selected;
        self.state = before.state;
        self.loaded_ns = before.loaded_ns;
        self.taken_ns = before.taken_ns;
        if let (Some(shining), Some(emitted)) = (&mut self.shining, before.emitted) {
            shining.put_back(emitted);
        }
        self.settle();
    }
}
