//! Where messages on their way to the device end, in whatever dialect they are, and what they ask.

use super::log;
use phasmid_protocol::dialect::{Cut, Cutter, Dialect, Direction};
use phasmid_protocol::scpi::{Framer, Framing};
use std::sync::Arc;

/// Listens to a line.
#[derive(Debug, Default)]
pub(super) struct Listener {
    /// `None` where SCPI is spoken.
    dialect: Option<(Arc<Dialect>, Cutter)>,
    framer: Framer,
}

impl Listener {
    /// Listens to a dialect.
    pub(super) fn new(dialect: Option<&Arc<Dialect>>) -> Self {
        let dialect = dialect.filter(|dialect| !dialect.is_scpi());
        Self {
            dialect: dialect.map(|d| (d.clone(), d.cutter(Direction::ToDevice))),
            framer: Framer::default(),
        }
    }

    /// Hears a byte; where it ends a message, what that is: of a line its text, of a packet the name
    /// of its command, and nothing of what nobody could understand.
    pub(super) fn hear(&mut self, byte: u8) -> Option<String> {
        let mut ended = None;
        match &mut self.dialect {
            None => self.framer.push(&[byte], &mut |framing| {
                ended = Some(match framing {
                    Framing::Message(message) => log::command(&message),
                    Framing::Dropped(_) => String::new(),
                });
            }),
            Some((dialect, cutter)) => cutter.push(&[byte], &mut |cut| {
                ended = Some(match cut {
                    Cut::Message(message) if dialect.has_sequence() => {
                        let asked = dialect.asked(&message);
                        asked.map_or(String::new(), |asked| asked.command)
                    }
                    Cut::Message(message) => log::command(&message),
                    Cut::Dropped(_) => String::new(),
                });
            }),
        }
        ended
    }

    /// What a device that has no time replies to a message; empty where the dialect has no such
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

    /// Forgets the beginning of a message.
    pub(super) fn reset(&mut self) {
        self.framer.reset();
        if let Some((_, cutter)) = &mut self.dialect {
            cutter.reset();
        }
    }
}
