//! Faults: wrappers around the device's inputs and outputs, driven by a
//! [schedule](phasmid_protocol::faults). Firmware, optics and links do not know about them.
//!
//! All times are device time and random draws are counter-based, so that the same schedule always
//! gives the same run. The total size of delayed items is bounded; frames and replies beyond the
//! bound are lost, as in any driver.

mod armed;
mod camera;
mod chance;
mod frame;
mod held;
mod listener;
mod port;
#[cfg(test)]
mod tests;

pub use camera::PatternImages;
pub use port::Incoming;

use armed::{Armed, Event, Way};
use chance::{Chance, Draws};
use held::Held;
use listener::Listener;
use phasmid_protocol::Frame;
use phasmid_protocol::faults::{Fault, Flaw, MAX_FAULTS, Schedule, Struck, What};
use std::collections::VecDeque;
use std::sync::Arc;

/// Maximum total size in bytes of frames that wait behind a delayed frame.
const MAX_FRAME_BYTES: usize = 256 << 20;
/// Maximum total size in bytes of replies that wait behind a delayed reply.
const MAX_REPLY_BYTES: usize = 4 << 20;
/// Number of log entries kept; older ones are only counted.
const REMEMBERED: usize = 4096;

/// Converts milliseconds to nanoseconds.
fn ns(ms: f64) -> u64 {
    (ms * 1e6) as u64
}

/// All faults of one device.
#[derive(Debug)]
pub struct Faults {
    /// The device's name.
    device: String,
    /// Number of rows of the device's camera.
    rows: u32,
    armed: Vec<Armed>,
    next_id: u64,
    chance: Chance,
    log: Log,
    /// Latest device time passed to any method, in nanoseconds.
    now_ns: u64,
    /// Effects to apply to frames that have not arrived yet, by frame id.
    planned: VecDeque<(u64, Vec<(What, Draws)>)>,
    /// The previous frame.
    before: Option<Arc<Frame>>,
    /// A frame that waits until the next frame has overtaken it, and its latest departure time.
    aside: Option<(u64, Arc<Frame>)>,
    frames: Held<Arc<Frame>>,
    /// Id of the last frame lost because of a reset.
    lost_to: Option<u64>,
    listener: Listener,
    /// The last command received.
    command: String,
    /// Bytes of an incomplete message that a fault may strike.
    unfinished: Vec<u8>,
    replies: Held<Vec<u8>>,
    /// Device time until which the port is disconnected, in nanoseconds.
    gone_until_ns: u64,
    /// Whether the port was disconnected without [`Self::take_broken`] having reported it.
    broken: bool,
    /// A restart of the device is pending.
    reset: bool,
}

/// An active fault, and how often it has struck.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Standing<'a> {
    /// Number of the fault.
    pub id: u64,
    /// The fault.
    pub fault: &'a Fault,
    /// Number of times it has struck.
    pub struck: u64,
}

impl Default for Faults {
    fn default() -> Self {
        Self::new(&Schedule::default(), "")
    }
}

impl Faults {
    /// Returns the faults of a schedule that apply to the device with this name. Their numbers are
    /// their positions in the schedule, from 1, including faults of other devices.
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

    /// Checks that the faults fit a camera with `rows` rows, which later faults must fit as well.
    ///
    /// # Errors
    /// Returns an error, with the fault's number, for the first fault that starts beyond the last
    /// row.
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
        match fault.what {
            What::Torn { row: Some(row) } | What::RowsMissing { row: Some(row), .. }
                if row >= self.rows =>
            {
                Err(Flaw {
                    field: "row".to_owned(),
                    found: row.to_string(),
                    allowed: format!("up to {}: the camera has {} rows", self.rows - 1, self.rows),
                })
            }
            _ => Ok(()),
        }
    }

    /// Adds a fault and returns its number. The fault counts events from now on.
    ///
    /// # Errors
    /// Returns an error for an invalid fault, a fault of another device, or if there are too many.
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
                found: "one fault too many".to_owned(),
                allowed: format!("at most {MAX_FAULTS} at a time"),
            });
        }
        let id = self.next_id;
        self.next_id += 1;
        self.armed.push(Armed::new(id, fault));
        Ok(id)
    }

    /// Removes a fault; returns `false` if no fault has this number. Effects that it has already had
    /// stay.
    pub fn remove(&mut self, id: u64) -> bool {
        let count = self.armed.len();
        self.armed.retain(|armed| armed.id != id);
        self.armed.len() < count
    }

    /// Removes all faults.
    pub fn clear(&mut self) {
        self.armed.clear();
    }

    /// Returns the active faults by number, including faults that have struck as often as allowed.
    pub fn standing(&self) -> impl Iterator<Item = Standing<'_>> {
        self.armed.iter().map(|armed| Standing {
            id: armed.id,
            fault: &armed.fault,
            struck: armed.struck,
        })
    }

    /// Returns the latest strikes of faults, oldest first.
    pub fn struck(&self) -> impl DoubleEndedIterator<Item = &Struck> {
        self.log.latest()
    }

    /// Returns how many times faults have struck since power-on.
    pub fn struck_in_all(&self) -> u64 {
        self.log.total()
    }

    /// Returns the time of the next event: a delayed item is due or the port reconnects.
    pub fn next_event_ns(&self) -> Option<u64> {
        let gone = (!self.connected(self.now_ns)).then_some(self.gone_until_ns);
        let aside = self.aside.as_ref().map(|(until_ns, _)| *until_ns);
        [self.frames.next_ns(), aside, self.replies.next_ns(), gone]
            .into_iter()
            .flatten()
            // An item that is already due waits to be taken; it is not a future event.
            .filter(|time_ns| *time_ns > self.now_ns)
            .min()
    }

    /// Returns whether the port was disconnected since the last call. A disconnection hangs up the
    /// client.
    pub fn take_broken(&mut self) -> bool {
        std::mem::take(&mut self.broken)
    }

    /// Returns whether a restart of the device was requested since the last call.
    pub fn take_reset(&mut self) -> bool {
        std::mem::take(&mut self.reset)
    }

    fn disconnect(&mut self, for_ns: u64) {
        self.gone_until_ns = self.gone_until_ns.max(self.now_ns.saturating_add(for_ns));
        self.broken = true;
        self.hang_up();
    }

    /// Restarts the device: everything that has not been sent is lost, including the frames of all
    /// exposures up to id `last`.
    fn reset(&mut self, last: Option<u64>) {
        self.reset = true;
        self.lost_to = self.lost_to.max(last);
        self.planned.clear();
        self.aside = None;
        self.frames.clear();
        self.replies.clear();
    }

    /// Returns the effects that strike an event, in the order of the schedule.
    fn strike(&mut self, way: Way, event: &Event<'_>, frame: Option<u64>) -> Vec<(What, Draws)> {
        let mut effects = Vec::new();
        for armed in self.armed.iter_mut().filter(|armed| armed.way() == way) {
            let Some(effect) = armed.strike(event, self.chance) else {
                continue;
            };
            self.log.push(Struck {
                time_ns: event.time_ns,
                fault: armed.id,
                what: armed.fault.what.to_string(),
                frame,
                command: (!event.command.is_empty()).then(|| event.command.to_owned()),
            });
            effects.push(effect);
        }
        effects
    }
}

/// The latest strikes of faults, and their total number.
#[derive(Debug, Clone, Default)]
struct Log {
    latest: VecDeque<Struck>,
    total: u64,
}

impl Log {
    fn push(&mut self, struck: Struck) {
        if self.latest.len() == REMEMBERED {
            self.latest.pop_front();
        }
        self.latest.push_back(struck);
        self.total += 1;
    }

    fn latest(&self) -> impl DoubleEndedIterator<Item = &Struck> {
        self.latest.iter()
    }

    fn total(&self) -> u64 {
        self.total
    }
}
