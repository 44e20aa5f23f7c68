//! Exposures that the trigger system starts, of the selected sequence or free-running, and the light
//! that reaches them.

use super::memory::Stored;
use super::settings::{Settings, Shown, seconds};
use super::shining::{Shining, level};
use super::table::{self, Command};
use super::trigger::Exposed;
use super::{Firmware, State, status};
use crate::projection::{self, Lit};
use crate::{Exposure, Readout, Shot, Showing, Stream};
use phasmid_pattern::Pattern;
use phasmid_profile::Timing;
use phasmid_protocol::scpi::{DeviceError, ErrorCode, Unit};
use phasmid_render::led::Emission;
use std::ops::Range;
use std::sync::Arc;

/// Flag bit that gives free-running exposures different noise from triggered exposures.
const FREE_RUNNING: u64 = 1 << 63;

impl Firmware {
    /// Returns the patterns and shots of the selected sequence with the present settings, for ground
    /// truth, without exposing anything. Start times come from the last complete run of the
    /// sequence; if there is none, the sequence is assumed to start now.
    pub fn selected_sequence(&self) -> Vec<(Pattern, Shot)> {
        let count = self.selected.pattern_images.len();
        let start_ns = |i: usize| {
            let now = i as u64 * self.settings.period_ns + self.now_ns;
            let taken = self
                .taken_ns
                .get(i)
                .filter(|_| self.taken_ns.len() == count);
            taken.copied().unwrap_or(now)
        };
        let shots = (0..count).map(|i| {
            let mut shot = Shot {
                pattern_index: Some(i as u32),
                light: self.settings.current,
                emission: self.shining.as_ref().and_then(|s| s.taken(i, count)),
                start_ns: start_ns(i),
                exposure_ns: self.settings.exposure_ns,
                shutter: self.settings.shutter(),
                gain_db: self.settings.gain_db,
                ..Shot::default()
            };
            self.show(&mut shot, (i..count).map(|i| (i, start_ns(i))));
            shot
        });
        let frames = self.selected.manifest.frame.iter();
        frames.map(|f| f.pattern.clone()).zip(shots).collect()
    }

    /// Sets the patterns that a shot of the selected sequence sees with the lamp on. `patterns`
    /// gives positions in the sequence and exposure starts; the first entry is the shot's own. A
    /// projector without timing switches directly from one pattern to the next and keeps the last
    /// pattern until the frame ends; a projector with timing is dark before and after each pattern.
    fn show(&self, shot: &mut Shot, patterns: impl IntoIterator<Item = (usize, u64)>) {
        let pattern_images = &self.selected.pattern_images;
        let end_ns = shot.end_ns();
        let mut seen = patterns
            .into_iter()
            .take_while(|(_, start_ns)| *start_ns <= end_ns)
            .filter_map(|(place, start_ns)| Some((pattern_images.get(place)?.clone(), start_ns)));
        let Some(timing) = &self.profile.projector.timing else {
            shot.pattern_image = seen.next().map(|(pattern_image, _)| pattern_image);
            shot.then = seen
                .filter(|(_, from_ns)| *from_ns < end_ns)
                .map(|(pattern_image, from_ns)| Showing {
                    from_ns,
                    pattern_image: Some(pattern_image),
                    light: shot.light,
                })
                .collect();
            return;
        };
        let lit = seen.map(|(pattern_image, start_ns)| {
            let lit = self.period(timing, start_ns).lit;
            Lit {
                pattern_image,
                from_ns: lit.start,
                to_ns: lit.end,
            }
        });
        let planes = timing
            .bit_planes
            .then_some((&self.planes, self.profile.projector.bits));
        projection::show(shot, lit, planes);
    }

    /// Returns the stream format that results from the present settings.
    pub fn stream(&self) -> Stream {
        self.stream_with(&self.settings)
    }

    fn stream_with(&self, settings: &Settings) -> Stream {
        let interval_ns = settings.interval_ns.max(settings.shortest_period_ns());
        self.readout(settings).stream(interval_ns)
    }

    fn readout(&self, settings: &Settings) -> Readout {
        let camera = &self.profile.camera;
        let full_scale_dn = camera.sensor.full_scale_dn() as u16;
        Readout {
            roi: settings.roi,
            format: settings.format,
            data_line: camera.data_line.then_some(full_scale_dn),
        }
    }

    /// Applies settings once the attached link is ready for the resulting frames.
    pub(super) fn apply(&mut self, settings: Settings) -> Result<(), DeviceError> {
        let stream = self.stream_with(&settings);
        if stream != self.stream()
            && let Some(link) = &mut self.link
        {
            link.announce(&stream)
                .map_err(|why| ErrorCode::SettingsConflict.with(why.to_string()))?;
        }
        self.settings = settings;
        Ok(())
    }

    /// Returns whether a command must wait until all frames have left, because the attached link
    /// cannot carry frames of two formats at the same time.
    pub(super) fn held_by_frames(&self, unit: &Unit) -> bool {
        self.link.is_some()
            && self.in_flight > 0
            && matches!(self.state, State::Idle | State::Armed { .. })
            && !unit.query
            && matches!(
                table::find(unit),
                Ok(Command::Format | Command::Roi | Command::Reset)
            )
    }

    pub(super) fn rest(&mut self) {
        self.state = State::rest(&self.settings, self.streaming, self.now_ns);
    }

    /// Returns whether a command must wait until the device is ready to be armed.
    pub(super) fn held_by_time(&self, unit: &Unit) -> bool {
        matches!(self.state, State::Idle)
            && self.now_ns < self.ready_ns()
            && !unit.query
            && matches!(table::find(unit), Ok(Command::Initiate))
    }

    /// Handles a trigger. A trigger that arrives before the armed device is ready is missed and
    /// counted.
    pub(super) fn fire(&mut self) -> Result<(), DeviceError> {
        let len = self.sequence_len();
        let early = match self.state {
            State::Running { .. } => true,
            State::Armed { .. } => self.now_ns < self.ready_ns(),
            State::Idle | State::Free { .. } => false,
        };
        if early {
            self.missed += 1;
            self.status.questionable.happen(status::TRIGGER_MISSED);
        }
        if early && let State::Armed { .. } = self.state {
            let why = match self.now_ns < self.loaded_ns {
                true => "the sequence is still loaded",
                false => "the last pattern's period or the camera's interval has not ended",
            };
            let left_s = seconds(self.ready_ns() - self.now_ns);
            return Err(ErrorCode::TriggerIgnored.with(format!("{left_s} s too early: {why}")));
        }
        self.state.trigger(&self.settings, len, self.now_ns)
    }

    pub(super) fn select(&mut self, stored: Arc<Stored>) {
        self.settings.period_ns = stored.period_ns;
        if !Arc::ptr_eq(&self.selected, &stored) && stored.load_ns > 0 {
            self.loaded_ns = self.now_ns.saturating_add(stored.load_ns);
        }
        self.selected = stored;
        self.taken_ns.clear();
        self.shining.iter_mut().for_each(Shining::forget);
        if matches!(self.settings.shown, Shown::Pattern(i) if i >= self.sequence_len()) {
            self.settings.shown = Shown::White;
        }
    }

    pub(super) fn expose(&mut self, exposed: Exposed) {
        let Settings {
            exposure_ns,
            gain_db,
            current,
            shown,
            ..
        } = self.settings;
        let timing = self.profile.projector.timing.as_ref();
        let mut gap_ns = self.settings.shortest_interval_ns;
        if let Some(index) = exposed.index {
            self.taken_ns.truncate(index as usize);
            self.taken_ns.push(exposed.start_ns);
            gap_ns = gap_ns.max(timing.map_or(0, |_| self.settings.period_ns));
        }
        if gap_ns > 0 {
            self.free_from_ns = exposed.start_ns.saturating_add(gap_ns);
        }
        let triggered = exposed.index.is_some();
        let noise_id = if triggered {
            self.triggered
        } else {
            FREE_RUNNING | (self.next_id - self.triggered)
        };
        let mut shot = Shot {
            id: self.next_id,
            noise_id,
            pattern_index: exposed.index,
            light: current,
            start_ns: exposed.start_ns,
            exposure_ns,
            shutter: self.settings.shutter(),
            gain_db,
            ..Shot::default()
        };
        match exposed.index {
            Some(index) => {
                let period_ns = self.settings.period_ns;
                let starts = (index..exposed.end).enumerate().map(|(i, place)| {
                    let after_ns = period_ns.saturating_mul(i as u64);
                    (place as usize, exposed.start_ns.saturating_add(after_ns))
                });
                self.show(&mut shot, starts.clone());
                self.open(starts.map(|(_, start_ns)| start_ns), shot.end_ns());
            }
            None => {
                shot.pattern_image = Some(match shown {
                    Shown::White => self.white.clone(),
                    Shown::Black => self.black.clone(),
                    Shown::Pattern(index) => self.selected.pattern_images[index as usize].clone(),
                });
            }
        }
        shot.emission = self.emission(exposed.index, exposed.start_ns);
        if !self.shows() {
            shot.pattern_image = None;
            shot.then
                .iter_mut()
                .for_each(|showing| showing.pattern_image = None);
        }
        self.exposures.push(Exposure {
            shot,
            readout: self.readout(&self.settings),
        });
        self.next_id += 1;
        self.triggered += u64::from(triggered);
        self.in_flight += 1;
    }
}

/// A pattern's period, and the interval within it in which the pattern is shown, in nanoseconds of
/// device time.
struct Period {
    all: Range<u64>,
    lit: Range<u64>,
}

impl Firmware {
    /// Makes the light source follow the settings from now on.
    pub(super) fn drive(&mut self) {
        if let Some(shining) = &mut self.shining {
            shining.source.drive(self.now_ns, level(&self.settings));
        }
    }

    /// Returns the period in which a projector with this `timing` shows the pattern of an exposure
    /// that starts at `start_ns`.
    fn period(&self, timing: &Timing, start_ns: u64) -> Period {
        let period_ns = self.settings.period_ns;
        let begins_ns = start_ns.saturating_sub(timing.camera_delay_ns());
        let from_ns = begins_ns.saturating_add(timing.dark_before_ns());
        let to_ns = from_ns.saturating_add(self.settings.pattern_ns(timing, period_ns));
        Period {
            all: begins_ns..begins_ns.saturating_add(period_ns),
            lit: from_ns..to_ns,
        }
    }

    /// Switches the source of a projector with timing off between the patterns of a sequence, for
    /// exposures that start at `starts_ns`, until `until_ns`. Between sequences the source is on.
    fn open(&mut self, starts_ns: impl Iterator<Item = u64>, until_ns: u64) {
        let Some(timing) = &self.profile.projector.timing else {
            return;
        };
        let periods: Vec<_> = starts_ns
            .take_while(|start_ns| *start_ns <= until_ns)
            .map(|start_ns| self.period(timing, start_ns))
            .collect();
        let Some(shining) = &mut self.shining else {
            return;
        };
        for Period { all, lit } in periods {
            shining.source.open(all.start, false);
            shining.source.open(lit.start, true);
            shining.source.open(lit.end, false);
            shining.source.open(all.end, true);
        }
    }

    /// Returns the light source's emission for an exposure from `start_ns` on.
    fn emission(&mut self, index: Option<u32>, start_ns: u64) -> Option<Arc<Emission>> {
        let shining = self.shining.as_mut()?;
        Some(shining.expose(index, start_ns))
    }

    /// Returns whether the projector may emit light: its lamp is on, or it has a modelled source,
    /// which keeps glowing after it is switched off.
    fn shows(&self) -> bool {
        self.settings.lamp || self.shining.is_some()
    }
}
