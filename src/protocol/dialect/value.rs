//! Data exchanged between a dialect and its users: values, events and errors.

use crate::scpi::{DeviceError, ErrorCode};
use std::fmt::{self, Display};

/// A value of an argument or of a reply, in base units: seconds, decibels, 1 for the whole.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// A finite number in its quantity's base unit.
    Number(f64),
    /// A word or a text. Where the file gives a field `choices`, the device's word for what the wire
    /// says.
    Text(String),
    /// Bytes.
    Bytes(Vec<u8>),
}

impl Value {
    /// The number, where it is one.
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(*number),
            _ => None,
        }
    }

    /// The text, where it is one; bytes that are UTF-8 are.
    pub fn text(&self) -> Option<&str> {
        match self {
            Self::Text(text) => Some(text),
            Self::Bytes(bytes) => std::str::from_utf8(bytes).ok(),
            Self::Number(_) => None,
        }
    }
}

impl Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => number.fmt(f),
            Self::Text(text) => text.fmt(f),
            Self::Bytes(bytes) => String::from_utf8_lossy(bytes).fmt(f),
        }
    }
}

impl From<f64> for Value {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

/// An unsolicited message from the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// The device was powered on or restarted.
    Booted,
    /// An exposure of a sequence has ended.
    Exposed {
        /// Position of the pattern in the sequence.
        index: u64,
        /// Id of its frame.
        id: u64,
    },
    /// A sequence has ended.
    SequenceDone,
    /// A trigger arrived when none was expected.
    TriggerMissed,
}

/// Meaning of a message for the host that sent the request.
#[derive(Debug, Clone, PartialEq)]
pub enum Reply {
    /// The answer is complete; its values by their names in the file.
    Done(Vec<(String, Value)>),
    /// A line of a multi-line answer that is not yet complete.
    More(Vec<(String, Value)>),
    /// The device refuses.
    Refused {
        /// The dialect's number of the error; 0 where a refusal bears none.
        number: i64,
        /// The dialect's or the device's words, empty where a refusal bears none.
        text: String,
    },
    /// Not an answer, but an unsolicited message.
    Event(Event),
    /// Valid, but not an answer to this request: another sequence number or command, or an echo.
    Other,
    /// Damaged, or not of this dialect; says what is wrong.
    Bad(String),
}

/// A message that the device understood.
#[derive(Debug, Clone, PartialEq)]
pub struct Asked {
    /// Name of the command in the dialect's file.
    pub command: String,
    /// Its arguments in base units, in the file's order.
    pub args: Vec<(String, Value)>,
    /// The packet's sequence number; 0 in dialects of lines.
    pub sequence: u8,
    /// Whether a reply is wanted.
    pub wants_reply: bool,
}

/// A message that the device did not understand.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WireError {
    /// What is wrong, by the numbers that the firmware has for its own errors.
    pub error: DeviceError,
    /// What its answer repeats of the packet.
    pub head: Head,
    /// Whether it is to be answered: a damaged packet is not.
    pub wants_reply: bool,
}

/// What a packet's header says, as far as it could be read; else zeros.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Head {
    /// Its sequence number.
    pub sequence: u8,
    /// Its command's number.
    pub code: u32,
    /// Whether it asks.
    pub read: bool,
}

impl WireError {
    /// A line that is no command; it is answered.
    pub(super) fn line(error: DeviceError) -> Self {
        Self {
            error,
            head: Head::default(),
            wants_reply: true,
        }
    }

    /// A message that cannot be read as one.
    pub(super) fn damaged(what: impl Display) -> Self {
        Self {
            error: ErrorCode::CommandError.with(what),
            head: Head::default(),
            wants_reply: false,
        }
    }
}

impl Display for WireError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.error.fmt(f)
    }
}

/// Something that the device says after power-on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Boot {
    /// When, in nanoseconds after power-on.
    pub delay_ns: u64,
    /// As it goes out on the wire.
    pub bytes: Vec<u8>,
}
