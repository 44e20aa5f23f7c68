//! Messages that are executed or wait, and what completed ones return.

use phasmid_protocol::scpi::{DeviceError, Program};

/// The command that holds up a message until no operation is pending.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Block {
    /// `*WAI`.
    Silent,
    /// `*OPC?`, which then answers 1.
    Answer,
}

/// A reply and the line that it answers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answered {
    /// The reply, with its newline.
    pub bytes: Vec<u8>,
    /// The line that it answers, truncated to `MAX_TO` bytes.
    pub to: String,
}

/// A completed message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Done {
    /// Ticket under which the message was submitted.
    pub ticket: u64,
    /// Answers to the message's queries, in order.
    pub answers: Vec<Vec<u8>>,
    /// Errors, in order.
    pub errors: Vec<DeviceError>,
}

/// Where answers and errors of a message go.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Origin {
    /// The control port; holds the line.
    Line(String),
    /// The holder of the ticket.
    Ticket(u64),
}

/// A message queued behind others.
#[derive(Debug)]
pub(super) struct Waiting {
    pub(super) program: Program,
    pub(super) len: usize,
    pub(super) origin: Origin,
}

/// The message being executed.
#[derive(Debug)]
pub(super) struct Current {
    pub(super) origin: Origin,
    /// Errors so far, if they are returned with a ticket.
    pub(super) errors: Vec<DeviceError>,
}
