//! Dialects: how a device's control port talks, as a file.

mod cutter;
mod uses;
mod value;

pub use cutter::{Cut, Cutter, Direction};
pub use uses::{Chunk, Gather, HostUse, MAX_CHUNKED_BYTES, Operation, Step};
pub use value::{Asked, Boot, Event, Reply, Value, WireError};

use crate::error::{Error, Result};
use crate::protocol::scpi::{DeviceError, ErrorCode};

/// A dialect, checked.
#[derive(Debug, Clone)]
pub struct Dialect {
    name: String,
    boot: Vec<Boot>,
    host: HostUse,
}

impl Dialect {
    /// A shipped dialect by its name, or else a file by its path.
    ///
    /// # Errors
    /// A name that is neither, unreadable files, and all that [`Self::parse`] refuses.
    pub fn load(name_or_path: &str) -> Result<Self> {
        Self::parse("", name_or_path)
    }

    /// Reads and checks a dialect from text; `place` stands for the file in messages.
    ///
    /// # Errors
    /// Syntax, unknown fields, wrong types, and whatever contradicts itself, each with its line.
    pub fn parse(_text: &str, place: &str) -> Result<Self> {
        Err(Error::input(place, "no dialect", "a dialect"))
    }

    /// Names of the shipped dialects.
    pub fn names() -> impl Iterator<Item = &'static str> {
        ["scpi", "dlpc350", "okline"].into_iter()
    }

    /// Name by which it is chosen.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether the device's own grammar is spoken (IEEE 488.2), so that its messages pass through.
    pub fn is_scpi(&self) -> bool {
        true
    }

    /// Whether messages are packets, with a number that a reply repeats.
    pub fn has_sequence(&self) -> bool {
        false
    }

    /// Every `runs` message of the file, with an example for each argument, and the place in the
    /// file (`FILE:LINE: field`): whoever has the device's commands checks that they are there.
    pub fn all_runs(&self) -> Vec<(String, String)> {
        Vec::new()
    }

    /// A fresh cutter for one direction.
    pub fn cutter(&self, _direction: Direction) -> Cutter {
        Cutter {}
    }

    /// Whether the device sends back what it receives: [`Self::echoed`] says how.
    pub fn echo(&self) -> bool {
        false
    }

    /// A received message as it is sent back, with its end.
    pub fn echoed(&self, message: &[u8]) -> Vec<u8> {
        message.to_vec()
    }

    /// What the device says after power-on, in order of time.
    pub fn boot(&self) -> &[Boot] {
        &self.boot
    }

    /// The host's operations.
    pub fn host(&self) -> &HostUse {
        &self.host
    }

    /// Names of the commands.
    pub fn commands(&self) -> impl Iterator<Item = &str> {
        std::iter::empty()
    }

    /// How a command's long answer is read in pieces; `None` where it comes whole.
    pub fn chunk(&self, _command: &str) -> Option<&Chunk> {
        None
    }

    /// Whether the device answers a command at all: SCPI does not answer an order.
    pub fn is_answered(&self, _command: &str) -> bool {
        true
    }

    /// A command as the host sends it, with its end.
    ///
    /// # Errors
    /// A command that the dialect does not have, and arguments that are missing, of another kind, or
    /// out of range.
    pub fn request(
        &self,
        command: &str,
        _args: &[(&str, Value)],
        _sequence: u8,
    ) -> Result<Vec<u8>, DeviceError> {
        Err(ErrorCode::UndefinedHeader.with(command))
    }

    /// What a message means to the host that has asked `command` with `sequence`.
    pub fn reply(&self, _command: &str, _message: &[u8], _sequence: u8) -> Reply {
        Reply::Other
    }

    /// What a message asks of the device.
    ///
    /// # Errors
    /// A message that is damaged, of a command that the dialect does not have, or whose arguments
    /// are none; [`Self::nack`] makes the answer.
    pub fn asked(&self, _message: &[u8]) -> Result<Asked, WireError> {
        Err(WireError::damaged("no dialect"))
    }

    /// The firmware's own (SCPI) messages that a command stands for, in order.
    pub fn runs(&self, _asked: &Asked) -> Vec<String> {
        Vec::new()
    }

    /// The reply with its end, made of the firmware's answers: one for each message of
    /// [`Self::runs`], without newlines, empty where a message has none. Empty where no reply is
    /// wanted.
    ///
    /// # Errors
    /// Answers that are not as the file has them.
    pub fn answer(&self, _asked: &Asked, _answers: &[Vec<u8>]) -> Result<Vec<u8>, DeviceError> {
        Ok(Vec::new())
    }

    /// The reply to a command that the firmware refuses, with the dialect's own number; empty where
    /// no reply is wanted.
    pub fn refusal(&self, _asked: &Asked, _error: &DeviceError) -> Vec<u8> {
        Vec::new()
    }

    /// The reply to a message that is no command; empty where it is not answered.
    pub fn nack(&self, _error: &WireError) -> Vec<u8> {
        Vec::new()
    }

    /// The reply of a device that has no time now (the file's `busy` error).
    pub fn busy(&self, _asked: &Asked) -> Vec<u8> {
        Vec::new()
    }

    /// What the device says unasked when something happens; `None` where the dialect does not tell.
    pub fn event(&self, _event: Event) -> Option<Vec<u8>> {
        None
    }
}
