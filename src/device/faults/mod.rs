//! What goes wrong on a bad day: wrappers around the ways into the device and out of it, driven by a
//! [schedule](phasmid_protocol::faults). Neither firmware nor optics nor links know of them.
//!
//! All times are device time, and chance is counter-based, so the same schedule makes the same day
//! again. What is held back has a bound; beyond it frames and replies are lost, as in any driver.

mod armed;
mod camera;
mod chance;
mod held;
mod listener;
mod log;
mod picture;
mod port;
#[cfg(test)]
mod tests;

pub use camera::Slides;
pub use port::Incoming;

use armed::{Armed, Event, Way};
use chance::{Chance, Draws};
use held::Held;
use listener::Listener;
use log::Log;
use phasmid_protocol::Frame;
use phasmid_protocol::faults::{Effect, Fault, Flaw, MAX_FAULTS, Schedule, Struck};
use std::collections::VecDeque;
use std::sync::Arc;

/// Bytes of frames that wait, behind one that is late.
const MAX_FRAME_BYTES: usize = 256 << 20;
/// Bytes of replies that wait, behind one that is late.
const MAX_REPLY_BYTES: usize = 4 << 20;

/// Everything that goes wrong with one device.
#[derive(Debug)]
pub struct Faults {
    /// The device's name.
    device: String,
    /// Rows of its camera.
    rows: u32,
    armed: Vec<Armed>,
    next_id: u64,
    chance: Chance,
    log: Log,
    /// The latest time that has been heard of.
    now_ns: u64,
    /// Frames that will be struck when they come, by their ids.
    planned: VecDeque<(u64, Vec<(Effect, Draws)>)>,
    /// The frame before the next one.
    before: Option<Arc<Frame>>,
    /// A frame that waits for the next one to overtake it, and until when.
    aside: Option<(u64, Arc<Frame>)>,
    frames: Held<Arc<Frame>>,
    /// The last frame that a reset has swallowed.
    lost_to: Option<u64>,
    listener: Listener,
    /// The last command that has come.
    command: String,
    /// What has come of a message that is not whole and may be struck.
    unfinished: Vec<u8>,
    replies: Held<Vec<u8>>,
    /// The port is gone until then.
    gone_until_ns: u64,
    /// The port has gone, and nobody has been told yet.
    broken: bool,
    /// The device is to boot.
    reset: bool,
}

/// A fault that is in force, and how often it has struck.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Standing<'a> {
    /// Its number.
    pub id: u64,
    /// What it is.
    pub fault: &'a Fault,
    /// How often it has struck.
    pub struck: u64,
}

impl Default for Faults {
    fn default() -> Self {
        Self::new(&Schedule::default(), "")
    }
}

impl Faults {
    /// The faults of a schedule that concern a device of a name. They are numbered from 1 in their
    /// order, those for other devices among them.
    pub fn new(schedule: &Schedule, device: &str) -> Self {
        let numbered = (1..).zip(&schedule.fault);
        Self {
            device: device.to_owned(),
            rows: u32::MAX,
            armed: numbered
                .filter(|(_, fault)| fault.concerns(device))
                .map(|(id, fault)| Armed::new(id, fault.clone()))
                .collect(),
            next_id: schedule.fault.len() as u64 + 1,
            chance: Chance::new(schedule.seed, device),
            log: Log::default(),
            now_ns: 0,
            planned: VecDeque::new(),
            before: None,
            aside: None,
            frames: Held::new(MAX_FRAME_BYTES),
            lost_to: None,
            listener: Listener::default(),
            command: String::new(),
            unfinished: Vec::new(),
            replies: Held::new(MAX_REPLY_BYTES),
            gone_until_ns: 0,
            broken: false,
            reset: false,
        }
    }

    /// The same for a camera of so many rows, beyond which no fault may begin.
    ///
    /// # Errors
    /// The first that does, by its number.
    pub fn of_rows(mut self, rows: u32) -> Result<Self, Flaw> {
        self.rows = rows;
        for armed in &self.armed {
            self.fits(&armed.fault).map_err(|flaw| Flaw {
                field: format!("fault[{}].{}", armed.id - 1, flaw.field),
                ..flaw
            })?;
        }
        Ok(self)
    }

    fn fits(&self, fault: &Fault) -> Result<(), Flaw> {
        match fault.row {
            Some(row) if row >= self.rows => Err(Flaw {
                field: "row".to_owned(),
                found: row.to_string(),
                allowed: format!("up to {}: the camera has {} rows", self.rows - 1, self.rows),
            }),
            _ => Ok(()),
        }
    }

    /// Adds a fault, which counts from now on; gives its number.
    ///
    /// # Errors
    /// A fault that cannot be, one for another device, and one more than there may be.
    pub fn add(&mut self, fault: Fault) -> Result<u64, Flaw> {
        fault.check()?;
        fault.check_device(&[&self.device])?;
        self.fits(&fault)?;
        if self.armed.len() >= MAX_FAULTS {
            self.armed.retain(|armed| !armed.is_over());
        }
        if self.armed.len() >= MAX_FAULTS {
            return Err(Flaw {
                field: "fault".to_owned(),
                found: "one more".to_owned(),
                allowed: format!("{MAX_FAULTS} at a time"),
            });
        }
        let id = self.next_id;
        self.next_id += 1;
        self.armed.push(Armed::new(id, fault));
        Ok(id)
    }

    /// Takes a fault away; false where there is none of that number. What it has done stays done.
    pub fn remove(&mut self, id: u64) -> bool {
        let count = self.armed.len();
        self.armed.retain(|armed| armed.id != id);
        self.armed.len() < count
    }

    /// Takes all faults away.
    pub fn clear(&mut self) {
        self.armed.clear();
    }

    /// The faults in force, by their numbers, those that have struck as often as they may included.
    pub fn standing(&self) -> impl Iterator<Item = Standing<'_>> {
        self.armed.iter().map(|armed| Standing {
            id: armed.id,
            fault: &armed.fault,
            struck: armed.struck,
        })
    }

    /// What has struck, in order: the latest few thousand.
    pub fn struck(&self) -> impl DoubleEndedIterator<Item = &Struck> {
        self.log.latest()
    }

    /// How often something has struck since power-on.
    pub fn struck_in_all(&self) -> u64 {
        self.log.total()
    }

    /// When something that was held back goes on.
    pub fn next_event_ns(&self) -> Option<u64> {
        let gone = (!self.connected(self.now_ns)).then_some(self.gone_until_ns);
        let aside = self.aside.as_ref().map(|(until_ns, _)| *until_ns);
        [self.frames.next_ns(), aside, self.replies.next_ns(), gone]
            .into_iter()
            .flatten()
            // What is due waits for somebody who takes it.
            .filter(|time_ns| *time_ns > self.now_ns)
            .min()
    }

    /// Whether the port has gone since this was asked last: the client hangs up.
    pub fn take_broken(&mut self) -> bool {
        std::mem::take(&mut self.broken)
    }

    /// Whether the device is to boot since this was asked last.
    pub fn take_reset(&mut self) -> bool {
        std::mem::take(&mut self.reset)
    }

    fn disconnect(&mut self, for_ns: u64) {
        self.gone_until_ns = self.gone_until_ns.max(self.now_ns.saturating_add(for_ns));
        self.broken = true;
        self.hang_up();
    }

    /// The device boots: what it had not sent is gone, frames of exposures up to `last` among it.
    fn reset(&mut self, last: Option<u64>) {
        self.reset = true;
        self.lost_to = self.lost_to.max(last);
        self.planned.clear();
        self.aside = None;
        self.frames.clear();
        self.replies.clear();
    }

    /// What strikes an event, in the order of the schedule.
    fn strike(&mut self, way: Way, event: &Event<'_>, frame: Option<u64>) -> Vec<(Effect, Draws)> {
        let mut effects = Vec::new();
        for armed in self.armed.iter_mut().filter(|armed| armed.way() == way) {
            let Some(effect) = armed.strike(event, self.chance) else {
                continue;
            };
            self.log.push(Struck {
                time_ns: event.time_ns,
                fault: armed.id,
                what: armed.fault.what,
                frame,
                command: (!event.command.is_empty()).then(|| event.command.to_owned()),
            });
            effects.push(effect);
        }
        effects
    }
}
