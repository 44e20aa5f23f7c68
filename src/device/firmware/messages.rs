//! Order of messages: which message executes, which messages wait, and where answers go.
//!
//! A line of the control port is answered on the port, and its errors are queued for
//! `SYSTem:ERRor?`. A message submitted with a ticket returns both with the ticket instead.

use super::pending::{Answered, Block, Current, Done, Origin, Waiting};
use super::table::{self, Command};
use super::{Firmware, State, status};
use phasmid_protocol::scpi::{DeviceError, ErrorCode, Unit, parse};

/// Maximum number of messages that wait behind `*WAI` or `*OPC?`.
const MAX_WAITING: usize = 64;
/// Maximum total size in bytes of waiting messages.
const MAX_WAITING_BYTES: usize = 64 << 20;
/// Maximum length of the command line kept with a reply, in bytes.
const MAX_TO: usize = 256;

impl Firmware {
    /// Submits a message, a line without its newline. Once the message has completed,
    /// [`Self::take_done`] returns its answers and errors with the ticket.
    pub fn submit(&mut self, message: &[u8], ticket: u64, now_ns: u64) {
        self.advance(now_ns);
        self.message(message, Origin::Ticket(ticket));
    }

    /// Returns whether a message executes at once even while other messages wait.
    pub fn acts_at_once(message: &[u8]) -> bool {
        let program = parse(message);
        program.error.is_none() && program.units.iter().all(urgent)
    }

    /// Checks that the device supports all commands of a message.
    ///
    /// # Errors
    /// Returns the first unsupported command, or the parse error.
    pub fn knows(message: &[u8]) -> Result<(), DeviceError> {
        let program = parse(message);
        for unit in &program.units {
            table::find(unit)?;
        }
        program.error.map_or(Ok(()), Err)
    }

    /// Takes the messages that were submitted with tickets and have completed since the last call.
    pub fn take_done(&mut self) -> Vec<Done> {
        std::mem::take(&mut self.done)
    }

    /// Handles a line of the control port.
    pub(super) fn line(&mut self, message: &[u8]) {
        let to = String::from_utf8_lossy(&message[..message.len().min(MAX_TO)]).into_owned();
        self.message(message, Origin::Line(to));
    }

    fn message(&mut self, message: &[u8], origin: Origin) {
        let program = parse(message);
        // A trigger or ABORt acts at once even behind a waiting *OPC?, like the interface messages
        // GET and DCL on a bus; otherwise no command could reach a device that waits for a trigger.
        if self.block.is_some() && program.error.is_none() && program.units.iter().all(urgent) {
            let errors = program.units.iter().filter_map(|u| self.execute(u).err());
            let errors = errors.collect();
            self.conclude(origin, Vec::new(), errors);
        } else if self.waiting.len() >= MAX_WAITING
            || self.waiting_bytes + message.len() > MAX_WAITING_BYTES
        {
            let error =
                ErrorCode::InputBufferOverrun.with("too many messages wait behind *WAI or *OPC?");
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

    /// Delivers the answers and errors of a completed message.
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

    /// Records an error of the message being executed.
    fn report(&mut self, error: DeviceError) {
        match &mut self.current {
            Some(Current {
                origin: Origin::Ticket(_),
                errors,
            }) => errors.push(error),
            _ => self.status.report(error),
        }
    }

    /// Executes all units and messages that need not wait.
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
                        // A command error voids the remaining units of its message.
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

    /// Returns whether an operation is pending: an `INITiate` is unfinished, frames of an `INITiate`
    /// have not left the device, a pattern is still shown, or a sequence is being loaded.
    /// Free-running or continuously armed operation never completes and does not count.
    fn pending(&self) -> bool {
        match self.state {
            State::Free { .. } => false,
            State::Idle => self.in_flight > 0 || self.now_ns < self.ready_ns(),
            State::Armed { .. } | State::Running { .. } => !self.settings.continuous,
        }
    }

    /// Updates the status registers and the light source.
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

/// Returns whether a unit executes at once even while messages wait.
fn urgent(unit: &Unit) -> bool {
    matches!(
        table::find(unit),
        Ok(Command::BusTrigger | Command::Trigger | Command::Abort | Command::Continuous)
    ) && !unit.query
}
