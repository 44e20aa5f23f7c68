//! Faults of frames. Whether a fault strikes a frame is decided at the frame's exposure. Effects on
//! the light are applied to the exposure, effects on the finished frame when the frame arrives from
//! the renderer.

use super::armed::{Event, Way};
use super::chance::Draws;
use super::{Faults, frame, ns};
use crate::{Exposure, PatternImage, Shot};
use phasmid_protocol::Frame;
use phasmid_protocol::faults::What;
use std::sync::Arc;

/// Maximum number of exposures that a fault has struck and whose frames have not arrived. Beyond it
/// the oldest entry is dropped; a served device never has that many frames in flight.
const MAX_PLANNED: usize = 16_384;

/// Pattern images of the selected sequence; `None` where the projector's light is off.
pub type PatternImages<'a> = &'a dyn Fn() -> Vec<Option<Arc<PatternImage>>>;

impl Faults {
    /// Applies faults to exposures on their way to the optics, without changing their number.
    /// `pattern_images` returns the pattern images of the sequence being exposed.
    pub fn exposures(
        &mut self,
        mut exposures: Vec<Exposure>,
        now_ns: u64,
        pattern_images: PatternImages<'_>,
    ) -> Vec<Exposure> {
        self.now_ns = self.now_ns.max(now_ns);
        let Some(last) = exposures.last().map(|exposure| exposure.shot.id) else {
            return exposures;
        };
        for Exposure { shot, .. } in &mut exposures {
            let command = self.command.clone();
            let event = Event {
                time_ns: shot.start_ns,
                command: &command,
                triggered: Some(shot.pattern_index.is_some()),
            };
            let mut later = Vec::new();
            for (effect, draws) in self.strike(Way::Camera, &event, Some(shot.id)) {
                match effect {
                    What::Dark => darken(shot),
                    What::WrongPattern { offset } => show_other(shot, offset, pattern_images),
                    What::PartialExposure { fraction } => dim(shot, fraction),
                    What::Disconnect { for_ms } => self.disconnect(ns(for_ms)),
                    // A reset clears the device's memory, so exposed frames are lost.
                    What::Reset => self.reset(Some(last)),
                    _ => later.push((effect, draws)),
                }
            }
            if !later.is_empty() {
                if self.planned.len() == MAX_PLANNED {
                    self.planned.pop_front();
                }
                self.planned.push_back((shot.id, later));
            }
        }
        exposures
    }

    /// Accepts a finished frame from the optics, on its way to the client.
    pub fn frame(&mut self, frame: Arc<Frame>, now_ns: u64) {
        self.now_ns = self.now_ns.max(now_ns);
        while self.planned.front().is_some_and(|(id, _)| *id < frame.id) {
            self.planned.pop_front();
        }
        let effects = match self.planned.front() {
            Some((id, _)) if *id == frame.id => self.planned.pop_front(),
            _ => None,
        };
        // Without faults the previous frame is not needed.
        let before = match self.armed.is_empty() {
            true => self.before.take(),
            false => self.before.replace(frame.clone()),
        };
        if self.lost_to.is_some_and(|last| frame.id <= last) {
            return;
        }
        let effects = effects.map_or(Vec::new(), |(_, effects)| effects);
        self.send(frame, effects, before.as_deref());
    }

    /// Applies the planned effects to a finished frame.
    fn send(&mut self, mut frame: Arc<Frame>, effects: Vec<(What, Draws)>, before: Option<&Frame>) {
        let (mut copies, mut late_ns, mut wait_ns) = (1, 0, None);
        for (effect, mut draws) in effects {
            match effect {
                What::Dropped => copies = 0,
                What::Repeated => copies = 2 * copies.min(1),
                What::Late { by_ms } => late_ns += ns(by_ms),
                What::Swapped { by_ms } => wait_ns = Some(ns(by_ms)),
                What::Torn { row } => frame::torn(Arc::make_mut(&mut frame), before, row),
                What::RowsMissing { row, rows } => {
                    frame::rows_missing(Arc::make_mut(&mut frame), row, rows);
                }
                What::BitsFlipped { count } => {
                    frame::bits_flipped(&mut Arc::make_mut(&mut frame).data, count, &mut draws);
                }
                // Already applied to the exposure.
                What::Dark
                | What::WrongPattern { .. }
                | What::PartialExposure { .. }
                | What::Disconnect { .. }
                | What::Reset => {}
                // Effects on the port do not concern frames.
                What::Nak
                | What::BitErrors { .. }
                | What::NoReply
                | What::LateReply { .. }
                | What::ReplyTwice
                | What::GarbageBefore { .. }
                | What::GarbageInside { .. } => {}
            }
        }
        if copies == 0 {
            return;
        }
        let due_ns = self.now_ns.saturating_add(late_ns);
        let first = self.aside.take();
        match (wait_ns, first) {
            // When two frames swap places, the first one takes the larger of both delays.
            (Some(wait_ns), first) => {
                self.aside = Some((due_ns.saturating_add(wait_ns), frame));
                if let Some((_, first)) = first {
                    self.hold(first, self.now_ns);
                }
            }
            (None, first) => {
                for _ in 0..copies {
                    self.hold(frame.clone(), due_ns);
                }
                if let Some((_, first)) = first {
                    self.hold(first, due_ns);
                }
            }
        }
    }

    fn hold(&mut self, frame: Arc<Frame>, due_ns: u64) {
        // A frame that does not fit into the queue is lost, as in any driver.
        let bytes = frame.data.len();
        let _ = self.frames.push(self.now_ns, due_ns, bytes, frame);
    }

    /// Returns the next frame that leaves by `now_ns`.
    pub fn next_frame(&mut self, now_ns: u64) -> Option<Arc<Frame>> {
        self.now_ns = self.now_ns.max(now_ns);
        if self
            .aside
            .as_ref()
            .is_some_and(|(until_ns, _)| *until_ns <= now_ns)
            && let Some((until_ns, frame)) = self.aside.take()
        {
            self.hold(frame, until_ns);
        }
        self.frames.pop(now_ns)
    }
}

/// Switches the projector's lamp off.
fn darken(shot: &mut Shot) {
    shot.pattern_image = None;
    shot.light = 0.0;
    for showing in &mut shot.then {
        showing.pattern_image = None;
        showing.light = 0.0;
    }
}

/// Lights the projector for a fraction of the exposure only; ambient light is unchanged.
fn dim(shot: &mut Shot, fraction: f64) {
    shot.light *= fraction;
    for showing in &mut shot.then {
        showing.light *= fraction;
    }
}

/// Shows another pattern of the sequence; positions wrap around at its ends.
fn show_other(shot: &mut Shot, offset: i32, pattern_images: PatternImages<'_>) {
    let (Some(index), Some(_)) = (shot.pattern_index, &shot.pattern_image) else {
        return;
    };
    let mut pattern_images = pattern_images();
    let Ok(count @ 1..) = i64::try_from(pattern_images.len()) else {
        return;
    };
    let other = (i64::from(index) + i64::from(offset)).rem_euclid(count);
    shot.pattern_image = pattern_images.swap_remove(other as usize);
}
