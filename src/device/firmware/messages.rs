//! Messages in their order: what is executed now, what waits, and what is answered.
//!
//! A line of the control port is answered there, and its errors queue up in `SYSTem:ERRor?`. Who
//! submits a message with a ticket gets both back with the ticket instead.

use super::table::{self, Command};
use super::{Block, Firmware, State, status};
use phasmid_protocol::scpi::{DeviceError, ErrorCode, Program, Unit, parse};

/// Messages that wait behind `*WAI` or `*OPC?`.
const MAX_WAITING: usize = 64;
/// Bytes of messages that wait.
const MAX_WAITING_BYTES: usize = 64 << 20;
/// Bytes of a line that are kept to say what a reply answers.
const MAX_TO: usize = 256;

/// What the device says to a line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answered {
    /// The reply with its newline.
    pub bytes: Vec<u8>,
    /// The line that it answers, or its beginning.
    pub to: String,
}

/// A message that has been worked off.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Done {
    /// With what it was submitted.
    pub ticket: u64,
    /// Answers of its queries, in order.
    pub answers: Vec<Vec<u8>>,
    /// What went wrong, in order.
    pub errors: Vec<DeviceError>,
}

/// Whom a message's answers and errors go to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Origin {
    /// The control port, with the line.
    Line(String),
    /// Whoever has the ticket.
    Ticket(u64),
}

/// A message that waits for those before it.
#[derive(Debug)]
pub(super) struct Waiting {
    program: Program,
    len: usize,
    origin: Origin,
}

/// The message that is being executed.
#[derive(Debug)]
pub(super) struct Current {
    pub(super) origin: Origin,
    /// Its errors so far, where they go back with a ticket.
    pub(super) errors: Vec<DeviceError>,
}

impl Firmware {
    /// Takes a message, a line without its newline, whose answers and errors
    /// [`Self::take_done`] gives back with the ticket once it has been worked off.
    pub fn submit(&mut self, message: &[u8], ticket: u64, now_ns: u64) {
        self.advance(now_ns);
        self.message(message, Origin::Ticket(ticket));
    }

    /// Whether a message acts at once even while others wait for something.
    pub fn acts_at_once(message: &[u8]) -> bool {
        let program = parse(message);
        program.error.is_none() && program.units.iter().all(urgent)
    }

    /// Whether the device has the commands of a message.
    ///
    /// # Errors
    /// The first that it does not have, or what makes it no message.
    pub fn knows(message: &[u8]) -> Result<(), DeviceError> {
        let program = parse(message);
        for unit in &program.units {
            table::find(unit)?;
        }
        program.error.map_or(Ok(()), Err)
    }

    /// Messages with tickets that have been worked off since this was asked last.
    pub fn take_done(&mut self) -> Vec<Done> {
        std::mem::take(&mut self.done)
    }

    /// A line of the control port.
    pub(super) fn line(&mut self, message: &[u8]) {
        let to = String::from_utf8_lossy(&message[..message.len().min(MAX_TO)]).into_owned();
        self.message(message, Origin::Line(to));
    }

    fn message(&mut self, message: &[u8], origin: Origin) {
        let program = parse(message);
        // A trigger or ABORt acts at once even behind a waiting *OPC?, as the interface messages
        // GET and DCL do on a bus; otherwise a device that waits for it could not be reached.
        if self.block.is_some() && program.error.is_none() && program.units.iter().all(urgent) {
            let errors = program.units.iter().filter_map(|u| self.execute(u).err());
            let errors = errors.collect();
            self.conclude(origin, Vec::new(), errors);
        } else if self.waiting.len() >= MAX_WAITING
            || self.waiting_bytes + message.len() > MAX_WAITING_BYTES
        {
            let error = ErrorCode::InputBufferOverrun.with("too much waits behind *WAI or *OPC?");
            self.conclude(origin, Vec::new(), vec![error]);
        } else {
            self.waiting_bytes += message.len();
            self.waiting.push_back(Waiting {
                program,
                len: message.len(),
                origin,
            });
        }
        self.run();
    }

    /// Tells of a message's end.
    fn conclude(&mut self, origin: Origin, answers: Vec<Vec<u8>>, errors: Vec<DeviceError>) {
        match origin {
            Origin::Ticket(ticket) => self.done.push(Done {
                ticket,
                answers,
                errors,
            }),
            Origin::Line(to) => {
                errors.into_iter().for_each(|e| self.status.report(e));
                if !answers.is_empty() {
                    let mut bytes = answers.join(&b';');
                    bytes.push(b'\n');
                    self.output.push(Answered { bytes, to });
                }
            }
        }
    }

    /// Takes an error of the message that is being executed.
    fn report(&mut self, error: DeviceError) {
        match &mut self.current {
            Some(Current {
                origin: Origin::Ticket(_),
                errors,
            }) => errors.push(error),
            _ => self.status.report(error),
        }
    }

    /// Executes what can be executed now.
    pub(super) fn run(&mut self) {
        self.settle();
        loop {
            if let Some(block) = self.block {
                if self.pending() {
                    return;
                }
                self.block = None;
                if block == Block::Answer {
                    self.answers.push(b"1".to_vec());
                }
            }
            let next = self.units.front();
            if next.is_some_and(|u| self.held_by_frames(u) || self.held_by_time(u)) {
                return;
            }
            if let Some(unit) = self.units.pop_front() {
                match self.execute(&unit) {
                    Ok(answer) => self.answers.extend(answer),
                    Err(error) => {
                        // A unit that was not understood voids the rest of its message.
                        if error.code.number() > -200 {
                            self.units.clear();
                            self.current_error = None;
                        }
                        self.report(error);
                    }
                }
                self.settle();
                continue;
            }
            if let Some(error) = self.current_error.take() {
                self.report(error);
            }
            let answers = std::mem::take(&mut self.answers);
            if let Some(Current { origin, errors }) = self.current.take() {
                self.conclude(origin, answers, errors);
            }
            let Some(Waiting {
                program,
                len,
                origin,
            }) = self.waiting.pop_front()
            else {
                return;
            };
            self.waiting_bytes -= len;
            self.units = program.units.into();
            self.current_error = program.error;
            self.current = Some(Current {
                origin,
                errors: Vec::new(),
            });
        }
    }

    /// Whether an operation is pending: an INITiate that is not worked off, frames of one that have
    /// not left the device, a pattern that is still shown, a sequence that is loaded. A camera that runs free, or is armed again and again, never ends.
    fn pending(&self) -> bool {
        match self.state {
            State::Free { .. } => false,
            State::Idle => self.in_flight > 0 || self.now_ns < self.ready_ns(),
            State::Armed { .. } | State::Running { .. } => !self.settings.continuous,
        }
    }

    /// Brings the status registers and the light source up to date.
    pub(super) fn settle(&mut self) {
        self.drive();
        let state = match self.state {
            State::Idle => 0,
            State::Armed { .. } => status::WAITING_FOR_TRIGGER,
            State::Free { .. } | State::Running { .. } => status::MEASURING,
        };
        let loading = match self.now_ns < self.loaded_ns {
            true => status::LOADING,
            false => 0,
        };
        self.status.operation.set(state | loading);
        if self.completion_asked && !self.pending() {
            self.completion_asked = false;
            self.status.raise(status::OPERATION_COMPLETE);
        }
    }
}

/// Whether a unit acts even while others wait.
fn urgent(unit: &Unit) -> bool {
    matches!(
        table::find(unit),
        Ok(Command::BusTrigger | Command::Trigger | Command::Abort | Command::Continuous)
    ) && !unit.query
}
