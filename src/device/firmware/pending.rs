//! Messages that are executing or waiting, and results of completed messages.

use phasmid_protocol::scpi::{DeviceError, Program};

/// The command that delays all further messages until no operation is pending.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Block {
    /// `*WAI`, which gives no answer.
    Silent,
    /// `*OPC?`, which answers 1 when no operation is pending.
    Answer,
}

/// A reply and the command line that it answers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answered {
    /// The reply, with its newline.
    pub bytes: Vec<u8>,
    /// The command line that the reply answers, truncated to `MAX_TO` bytes.
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

/// Destination of a message's answers and errors.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Origin {
    /// The control port; holds the command line.
    Line(String),
    /// The holder of the ticket.
    Ticket(u64),
}

/// A message queued behind other messages.
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
