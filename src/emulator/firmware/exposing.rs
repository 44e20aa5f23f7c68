//! What the trigger system sets off: exposures of the selected sequence, or of what is shown at rest.

use super::memory::Stored;
use super::settings::{Settings, Shown};
use super::shining::Shining;
use super::table::{self, Command};
use super::trigger::Exposed;
use super::{Firmware, State};
use crate::emulator::{Exposure, Readout, Shot, Showing, Stream};
use crate::pattern::Pattern;
use crate::protocol::scpi::{DeviceError, ErrorCode, Unit};
use std::sync::Arc;

/// Sets the noise of free-running exposures apart from that of triggered ones.
const FREE_RUNNING: u64 = 1 << 63;

impl Firmware {
    /// The selected sequence as it would be exposed with the present settings: what
    /// ground truth is asked about. Its times are those at which it was exposed last, or, if it has
    /// not been from its first pattern to its last, those of a trigger now. It exposes nothing.
    pub fn selected_sequence(&self) -> Vec<(Pattern, Shot)> {
        let count = self.selected.slides.len();
        let start_ns = |i: usize| {
            let now = i as u64 * self.settings.period_ns + self.now_ns;
            let taken = self
                .taken_ns
                .get(i)
                .filter(|_| self.taken_ns.len() == count);
            taken.copied().unwrap_or(now)
        };
        let shots = self
            .selected
            .slides
            .iter()
            .enumerate()
            .map(|(i, slide)| Shot {
                pattern_index: Some(i as u32),
                slide: Some(slide.clone()),
                light: self.settings.current,
                then: self.then(
                    (i + 1 < count).then(|| (i as u32 + 1, start_ns(i + 1))),
                    start_ns(i),
                    true,
                ),
                emission: self.shining.as_ref().and_then(|s| s.taken(i, count)),
                start_ns: start_ns(i),
                exposure_ns: self.settings.exposure_ns,
                shutter: self.settings.shutter(),
                gain_db: self.settings.gain_db,
                ..Shot::default()
            });
        let frames = self.selected.manifest.frame.iter();
        frames.map(|f| f.pattern.clone()).zip(shots).collect()
    }

    /// What the projector goes over to, at a time, while rows of an exposure from `start_ns` on are
    /// still exposed. After the last pattern of a trigger it keeps that until the frame has ended.
    fn then(&self, next: Option<(u32, u64)>, start_ns: u64, lamp: bool) -> Vec<Showing> {
        let end_ns = start_ns.saturating_add(self.settings.frame_ns());
        next.into_iter()
            .filter(|(_, from_ns)| *from_ns < end_ns)
            .filter_map(|(index, from_ns)| {
                let slide = self.selected.slides.get(index as usize)?;
                Some(Showing {
                    from_ns,
                    slide: lamp.then(|| slide.clone()),
                    light: self.settings.current,
                })
            })
            .collect()
    }

    /// What the camera's frames look like with the present settings.
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

    /// Takes settings over, once the link that has to know is ready for their frames.
    pub(super) fn apply(&mut self, settings: Settings) -> Result<(), DeviceError> {
        let stream = self.stream_with(&settings);
        if stream != self.stream()
            && let Some(link) = &mut self.link
        {
            link.announce(&stream)
                .map_err(|why| ErrorCode::SettingsConflict.with(why))?;
        }
        self.settings = settings;
        Ok(())
    }

    /// Whether an order has to wait until all frames have left, because a link that has to know
    /// what comes cannot carry frames of before and after it at the same time.
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

    pub(super) fn fire(&mut self) -> Result<(), DeviceError> {
        let len = self.sequence_len();
        self.state.trigger(&self.settings, len, self.now_ns)
    }

    pub(super) fn select(&mut self, stored: Arc<Stored>) {
        self.settings.period_ns = stored.period_ns;
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
        let slide = match exposed.index.map_or(shown, Shown::Pattern) {
            Shown::White => &self.white,
            Shown::Black => &self.black,
            Shown::Pattern(index) => &self.selected.slides[index as usize],
        };
        if let Some(index) = exposed.index {
            self.taken_ns.truncate(index as usize);
            self.taken_ns.push(exposed.start_ns);
        }
        let shows = self.shows();
        let then = self.then(exposed.next, exposed.start_ns, shows);
        let emission = (self.shining.as_mut()).map(|s| s.expose(exposed.index, exposed.start_ns));
        let triggered = exposed.index.is_some();
        let noise_id = if triggered {
            self.triggered
        } else {
            FREE_RUNNING | (self.next_id - self.triggered)
        };
        self.exposures.push(Exposure {
            shot: Shot {
                id: self.next_id,
                noise_id,
                pattern_index: exposed.index,
                slide: shows.then(|| slide.clone()),
                light: current,
                then,
                emission,
                start_ns: exposed.start_ns,
                exposure_ns,
                shutter: self.settings.shutter(),
                gain_db,
            },
            readout: self.readout(&self.settings),
        });
        self.next_id += 1;
        self.triggered += u64::from(triggered);
        self.in_flight += 1;
    }
}
