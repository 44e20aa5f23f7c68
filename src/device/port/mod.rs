//! The device side of the control port: turns incoming bytes into firmware commands and formats the
//! answers in the port's dialect.
//!
//! SCPI passes through to the firmware. Every other dialect is interpreted: a message of the
//! dialect maps to firmware messages, whose answers and errors return with a ticket and form the
//! reply, so that they never appear in SCPI's output or error queue.

mod interpreter;
#[cfg(test)]
mod tests;

pub use interpreter::Message;

use super::Firmware;
use interpreter::{Interpreter, unasked};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::dialect::{Dialect, Event};
use std::collections::VecDeque;
use std::sync::Arc;

/// The device side of the control port in one dialect. By default it speaks SCPI and sends nothing
/// unsolicited.
#[derive(Debug, Default)]
pub struct Port {
    dialect: Option<Arc<Dialect>>,
    /// Interpreter of the dialect; `None` if the firmware parses the messages itself (SCPI).
    interpreter: Option<Interpreter>,
    /// Power-on messages that are still to be sent and their times, in order of time.
    boot: VecDeque<(u64, Vec<u8>)>,
}

impl Port {
    /// Returns a port for a dialect, switched on at time 0.
    ///
    /// # Errors
    /// Returns an error, with the place in the dialect's file, if a command maps to a message that
    /// the firmware does not support.
    pub fn new(dialect: Arc<Dialect>) -> Result<Self> {
        for (message, place) in dialect.all_runs() {
            Firmware::knows(message.as_bytes()).map_err(|error| {
                let allowed = "SCPI commands of the device, such as TRIGger:SOURce BUS or *RST; the book \
                               lists them under `The control port`";
                Error::input(place, format!("{message:?}: {error}"), allowed)
            })?;
        }
        let interpreter = (!dialect.is_scpi()).then(|| Interpreter::new(dialect.clone()));
        let mut port = Self {
            dialect: Some(dialect),
            interpreter,
            boot: VecDeque::new(),
        };
        port.power_on(0);
        Ok(port)
    }

    /// Returns the dialect; `None` for SCPI.
    pub fn dialect(&self) -> Option<&Arc<Dialect>> {
        self.dialect.as_ref()
    }

    /// Schedules the power-on messages when the device is switched on.
    pub fn power_on(&mut self, now_ns: u64) {
        let Some(dialect) = &self.dialect else {
            return;
        };
        let at = |delay_ns: u64| now_ns.saturating_add(delay_ns);
        let boot = dialect.boot();
        self.boot = boot
            .iter()
            .map(|boot| (at(boot.delay_ns), boot.bytes.clone()))
            .collect();
        if let Some(bytes) = dialect.event(Event::Booted) {
            let last = boot.last().map_or(0, |boot| boot.delay_ns);
            self.boot.push_back((at(last), bytes));
        }
        if let Some(interpreter) = &mut self.interpreter {
            interpreter.clear();
        }
    }

    /// Receives bytes that have arrived.
    pub fn receive(&mut self, bytes: &[u8], firmware: &mut Firmware, now_ns: u64) {
        match &mut self.interpreter {
            Some(interpreter) => interpreter.receive(bytes, firmware, now_ns),
            None => firmware.receive(bytes, now_ns),
        }
    }

    /// Takes the messages due by `now_ns`, in order.
    pub fn collect(&mut self, firmware: &mut Firmware, now_ns: u64) -> Vec<Message> {
        let mut said = Vec::new();
        while self.boot.front().is_some_and(|(at, _)| *at <= now_ns) {
            said.extend(self.boot.pop_front().map(|(_, bytes)| unasked(bytes)));
        }
        let events = firmware.take_events();
        if let Some(dialect) = &self.dialect {
            let told = events.into_iter().filter_map(|event| dialect.event(event));
            said.extend(told.map(unasked));
        }
        match &mut self.interpreter {
            Some(interpreter) => said.extend(interpreter.collect(firmware, now_ns)),
            None => {
                let answered = firmware.take_answered().into_iter();
                said.extend(answered.map(|answered| Message {
                    bytes: answered.bytes,
                    to: Some(answered.to),
                }));
            }
        }
        said
    }

    /// Returns when the next unsolicited message is due.
    pub fn next_event_ns(&self) -> Option<u64> {
        self.boot.front().map(|(at, _)| *at)
    }

    /// Discards unfinished input and replies.
    pub fn hang_up(&mut self, firmware: &mut Firmware) {
        firmware.hang_up();
        if let Some(interpreter) = &mut self.interpreter {
            interpreter.clear();
        }
    }

    /// Returns whether the input is inside a message whose remaining bytes must arrive without a
    /// pause.
    pub fn inside_block(&self, firmware: &Firmware) -> bool {
        match &self.interpreter {
            Some(interpreter) => interpreter.inside(),
            None => firmware.inside_block(),
        }
    }

    /// Abandons a message whose remaining bytes have stopped arriving.
    pub fn input_stalled(&mut self, firmware: &mut Firmware) {
        match &mut self.interpreter {
            Some(interpreter) => interpreter.input_stalled(),
            None => firmware.input_stalled(),
        }
    }
}
