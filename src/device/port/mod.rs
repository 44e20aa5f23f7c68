//! The control port's inside: what comes on the wire becomes commands of the firmware, and what it
//! answers goes out as the dialect has it.
//!
//! SCPI is the firmware's own tongue and passes through. Any other dialect is interpreted: a message
//! of its own stands for messages of the firmware, whose answers and errors come back with a ticket
//! and make the reply, so that nothing of them is left in SCPI's output and error queue.

mod interpreter;
#[cfg(test)]
mod tests;

use super::Firmware;
use interpreter::Interpreter;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::dialect::{Dialect, Event};
use std::collections::VecDeque;
use std::sync::Arc;

/// Something that the device says.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Message {
    /// As it goes out on the wire.
    pub bytes: Vec<u8>,
    /// What it answers: the line as it came, or of a packet its command's name; `None` where nobody
    /// asked.
    pub to: Option<String>,
}

/// The device's side of a dialect. The default speaks SCPI and says nothing unasked.
#[derive(Debug, Default)]
pub struct Port {
    dialect: Option<Arc<Dialect>>,
    /// `None` where the firmware understands the messages by itself.
    interpreter: Option<Interpreter>,
    /// What is still to be said after power-on, in order of time.
    boot: VecDeque<(u64, Vec<u8>)>,
}

impl Port {
    /// A port that speaks a dialect, switched on at time 0.
    ///
    /// # Errors
    /// A dialect whose commands stand for messages that the firmware does not have, with the place
    /// in its file.
    pub fn new(dialect: Arc<Dialect>) -> Result<Self> {
        for (message, place) in dialect.all_runs() {
            Firmware::knows(message.as_bytes()).map_err(|error| {
                let allowed = "messages of the device: see its commands";
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

    /// What it speaks; `None` is SCPI.
    pub fn dialect(&self) -> Option<&Arc<Dialect>> {
        self.dialect.as_ref()
    }

    /// The device has been switched on: what it says then is to come.
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

    /// Takes bytes that have arrived.
    pub fn receive(&mut self, bytes: &[u8], firmware: &mut Firmware, now_ns: u64) {
        match &mut self.interpreter {
            Some(interpreter) => interpreter.receive(bytes, firmware, now_ns),
            None => firmware.receive(bytes, now_ns),
        }
    }

    /// What the device has to say by now, in order.
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

    /// When the port has something to say of its own accord.
    pub fn next_event_ns(&self) -> Option<u64> {
        self.boot.front().map(|(at, _)| *at)
    }

    /// Forgets unfinished input and replies.
    pub fn hang_up(&mut self, firmware: &mut Firmware) {
        firmware.hang_up();
        if let Some(interpreter) = &mut self.interpreter {
            interpreter.clear();
        }
    }

    /// Whether the input stands inside of a message that has to go on without a pause.
    pub fn inside_block(&self, firmware: &Firmware) -> bool {
        match &self.interpreter {
            Some(interpreter) => interpreter.inside(),
            None => firmware.inside_block(),
        }
    }

    /// Gives up on a message that stopped coming.
    pub fn input_stalled(&mut self, firmware: &mut Firmware) {
        match &mut self.interpreter {
            Some(interpreter) => interpreter.input_stalled(),
            None => firmware.input_stalled(),
        }
    }
}

fn unasked(bytes: Vec<u8>) -> Message {
    Message {
        bytes,
        ..Message::default()
    }
}
