//! Cuts a stream of bytes into a dialect's messages.

use super::WireError;

/// Which way a stream runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// From the host to the device.
    ToDevice,
    /// From the device to the host.
    ToHost,
}

/// What a stream gave.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Cut {
    /// A message: a line without its end, a packet whole.
    Message(Vec<u8>),
    /// Bytes that were thrown away, and why.
    Dropped(WireError),
}

/// The state of one stream. Its memory is bounded by the longest message.
#[derive(Debug, Clone)]
pub struct Cutter {}

impl Cutter {
    /// Takes bytes as they came and hands on every complete message.
    pub fn push(&mut self, _bytes: &[u8], _take: &mut dyn FnMut(Cut)) {}

    /// Whether a part of a message has come whose rest cannot be told from the next message: the
    /// driver calls [`Self::reset`] when it stops coming.
    pub fn inside(&self) -> bool {
        false
    }

    /// Throws away what has come of an unfinished message.
    pub fn reset(&mut self) {}
}
