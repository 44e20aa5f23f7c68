//! Finds the end of each message to the device, in any dialect, and identifies its command.

use phasmid_protocol::dialect::{Cut, Cutter, Dialect, Direction};
use phasmid_protocol::scpi::{Framer, Framing};
use std::sync::Arc;

/// Maximum number of bytes kept of a command.
const COMMAND_BYTES: usize = 256;

/// Follows the bytes that the client sends to the device.
#[derive(Debug, Default)]
pub(super) struct Listener {
    /// Dialect of the port and its message cutter; `None` for SCPI.
    dialect: Option<(Arc<Dialect>, Cutter)>,
    framer: Framer,
}

impl Listener {
    /// Returns a listener for a dialect.
    pub(super) fn new(dialect: Option<&Arc<Dialect>>) -> Self {
        let dialect = dialect.filter(|dialect| !dialect.is_scpi());
        Self {
            dialect: dialect.map(|d| (d.clone(), d.cutter(Direction::ToDevice))),
            framer: Framer::default(),
        }
    }

    /// Processes a byte. If the byte ends a message, returns the message's text (line dialects) or
    /// command name (packet dialects), or an empty string if the message cannot be parsed.
    pub(super) fn hear(&mut self, byte: u8) -> Option<String> {
        let mut ended = None;
        match &mut self.dialect {
            None => self.framer.push(&[byte], &mut |framing| {
                ended = Some(match framing {
                    Framing::Message(message) => command(&message),
                    Framing::Dropped(_) => String::new(),
                });
            }),
            Some((dialect, cutter)) => cutter.push(&[byte], &mut |cut| {
                ended = Some(match cut {
                    Cut::Message(message) if dialect.has_sequence() => {
                        let asked = dialect.asked(&message);
                        asked.map_or(String::new(), |asked| asked.command)
                    }
                    Cut::Message(message) => command(&message),
                    Cut::Dropped(_) => String::new(),
                });
            }),
        }
        ended
    }

    /// Returns the reply that a busy device gives to a message; empty if the dialect has no such
    /// reply.
    pub(super) fn busy(&self, message: &[u8]) -> Vec<u8> {
        let Some((dialect, _)) = &self.dialect else {
            return Vec::new();
        };
        let mut reply = Vec::new();
        let mut cutter = dialect.cutter(Direction::ToDevice);
        cutter.push(message, &mut |cut| {
            if let Cut::Message(message) = cut
                && let Ok(asked) = dialect.asked(&message)
            {
                reply = dialect.busy(&asked);
            }
        });
        reply
    }

    /// Discards an unfinished message.
    pub(super) fn reset(&mut self) {
        self.framer.reset();
        if let Some((_, cutter)) = &mut self.dialect {
            cutter.reset();
        }
    }
}

/// Returns a message as text, with invalid UTF-8 marked and truncated to [`COMMAND_BYTES`].
fn command(message: &[u8]) -> String {
    let end = message.len().min(COMMAND_BYTES);
    let text = String::from_utf8_lossy(&message[..end]);
    text.trim().to_owned()
}
