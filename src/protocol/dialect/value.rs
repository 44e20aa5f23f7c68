//! Data exchanged between a dialect and its users: values, events and errors.

use crate::scpi::{DeviceError, ErrorCode};
use std::fmt::{self, Display};

/// Direction in which a stream of bytes flows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// Host to device.
    ToDevice,
    /// Device to host.
    ToHost,
}

/// A value of an argument or a reply, in base units: seconds, decibels, 1 for 100 %.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// A finite number in the base unit of its quantity.
    Number(f64),
    /// A word or text. For a field with `choices`, the device's word rather than the wire value.
    Text(String),
    /// Bytes.
    Bytes(Vec<u8>),
}

impl Value {
    /// Returns the number; `None` for other types.
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(*number),
            _ => None,
        }
    }

    /// Returns the text, also of bytes that are valid UTF-8; `None` for other values.
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
        /// Id of the exposure's frame.
        id: u64,
    },
    /// A sequence has ended.
    SequenceDone,
    /// A trigger arrived at a time when the device could not act on it.
    TriggerMissed,
}

/// Meaning of a message for the host that sent a request.
#[derive(Debug, Clone, PartialEq)]
pub enum Reply {
    /// The answer is complete. Holds the values of the reply by their names in the dialect file.
    Done(Vec<(String, Value)>),
    /// A line of a multi-line answer of which further lines follow.
    More(Vec<(String, Value)>),
    /// The device refuses the request.
    Refused {
        /// Error number of the dialect; 0 if the refusal has no number.
        number: i64,
        /// Error text of the dialect or the device; empty if the refusal has no text.
        text: String,
    },
    /// An unsolicited message, not an answer.
    Event(Event),
    /// A valid message that does not answer this request: an echo, or an answer with another
    /// sequence number or command.
    Other,
    /// A message that is damaged or not part of this dialect. Holds the reason.
    Bad(String),
}

/// A message that the device recognizes.
#[derive(Debug, Clone, PartialEq)]
pub struct Asked {
    /// Name of the command in the dialect file.
    pub command: String,
    /// Arguments in base units, in the order of the dialect file.
    pub args: Vec<(String, Value)>,
    /// Sequence number of the packet; 0 in line dialects.
    pub sequence: u8,
    /// Whether a reply is wanted.
    pub wants_reply: bool,
}

/// A message that the device does not recognize.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WireError {
    /// The error, numbered like the firmware's own errors.
    pub error: DeviceError,
    /// Header fields of the packet, which the answer repeats.
    pub head: Head,
    /// Whether the device replies: damaged packets are not answered.
    pub wants_reply: bool,
}

/// Header fields of a packet; zero where they could not be read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Head {
    /// Sequence number.
    pub sequence: u8,
    /// Command code.
    pub code: u32,
    /// Whether the packet asks for data (read flag).
    pub read: bool,
}

impl WireError {
    /// Returns the error for a line that is not a valid command; the device replies to it.
    pub(super) fn line(error: DeviceError) -> Self {
        Self {
            error,
            head: Head::default(),
            wants_reply: true,
        }
    }

    /// Returns the error for a message that cannot be decoded; the device does not reply to it.
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

/// A message that the device sends after power-on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Boot {
    /// Delay after power-on in nanoseconds.
    pub delay_ns: u64,
    /// Bytes on the wire.
    pub bytes: Vec<u8>,
}
