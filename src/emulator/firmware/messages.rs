//! Messages in their order: what is executed now, what waits, and what is answered.

use super::table::{self, Command};
use super::{Block, Firmware, State, status};
use crate::protocol::scpi::{ErrorCode, Unit, parse};

/// Messages that wait behind `*WAI` or `*OPC?`.
const MAX_WAITING: usize = 64;
/// Bytes of messages that wait.
const MAX_WAITING_BYTES: usize = 64 << 20;

impl Firmware {
    pub(super) fn message(&mut self, message: &[u8]) {
        let program = parse(message);
        // A trigger or ABORt acts at once even behind a waiting *OPC?, as the interface messages
        // GET and DCL do on a bus; otherwise a device that waits for it could not be reached.
        if self.block.is_some() && program.error.is_none() && program.units.iter().all(urgent) {
            for unit in &program.units {
                if let Err(error) = self.execute(unit) {
                    self.status.report(error);
                }
            }
        } else if self.waiting.len() >= MAX_WAITING
            || self.waiting_bytes + message.len() > MAX_WAITING_BYTES
        {
            self.status
                .report(ErrorCode::InputBufferOverrun.with("too much waits behind *WAI or *OPC?"));
        } else {
            self.waiting_bytes += message.len();
            self.waiting.push_back((program, message.len()));
        }
        self.run();
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
            if self.current.front().is_some_and(|u| self.held_by_frames(u)) {
                return;
            }
            if let Some(unit) = self.current.pop_front() {
                match self.execute(&unit) {
                    Ok(answer) => self.answers.extend(answer),
                    Err(error) => {
                        // A unit that was not understood voids the rest of its message.
                        if error.code.number() > -200 {
                            self.current.clear();
                            self.current_error = None;
                        }
                        self.status.report(error);
                    }
                }
                self.settle();
                continue;
            }
            if let Some(error) = self.current_error.take() {
                self.status.report(error);
            }
            if !self.answers.is_empty() {
                self.output.extend(self.answers.join(&b';'));
                self.output.push(b'\n');
                self.answers.clear();
            }
            let Some((program, len)) = self.waiting.pop_front() else {
                return;
            };
            self.waiting_bytes -= len;
            self.current = program.units.into();
            self.current_error = program.error;
        }
    }

    /// Whether an operation is pending: an INITiate that is not worked off, or frames of one that
    /// have not left the device. A camera that runs free, or is armed again and again, never ends.
    fn pending(&self) -> bool {
        match self.state {
            State::Free { .. } => false,
            State::Idle => self.in_flight > 0,
            State::Armed { .. } | State::Running { .. } => !self.settings.continuous,
        }
    }

    /// Brings the status registers and the light source up to date.
    pub(super) fn settle(&mut self) {
        self.drive();
        self.status.operation.set(match self.state {
            State::Idle => 0,
            State::Armed { .. } => status::WAITING_FOR_TRIGGER,
            State::Free { .. } | State::Running { .. } => status::MEASURING,
        });
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
        Ok(Command::BusTrigger | Command::Trigger | Command::Abort)
    ) && !unit.query
}
