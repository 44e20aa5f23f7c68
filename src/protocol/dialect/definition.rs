//! A validated dialect: its name, framing, commands and unsolicited messages.

use super::command::{Command, Errors, Framing};
use super::cutter::Cutter;
use super::template::{Part, Template};
use super::uses::{Chunk, HostUse};
use super::value::{Boot, Direction, Event};

/// A validated dialect.
#[derive(Debug, Clone)]
pub struct Dialect {
    pub(super) name: String,
    pub(super) description: String,
    pub(super) framing: Framing,
    pub(super) echo: bool,
    pub(super) commands: Vec<Command>,
    pub(super) errors: Option<Errors>,
    pub(super) events: Vec<(Event, Template)>,
    pub(super) boot: Vec<Boot>,
    pub(super) host: HostUse,
    /// Examples of the firmware's messages, each with its location in the file.
    pub(super) runs: Vec<(String, String)>,
}

impl Dialect {
    /// Returns the name by which users select the dialect.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the one-line description for listings.
    pub fn description(&self) -> &str {
        &self.description
    }

    /// Returns whether the dialect is the device's native grammar (IEEE 488.2), so that messages
    /// pass through unchanged.
    pub fn is_scpi(&self) -> bool {
        matches!(self.framing, Framing::Scpi(_))
    }

    /// Returns a description of the message framing.
    pub fn framing(&self) -> String {
        match &self.framing {
            Framing::Scpi(_) => "SCPI".to_owned(),
            Framing::Line(ends) => format!("lines of up to {} bytes", ends.max),
            Framing::Packet(layout) => match layout.size {
                Some(size) => format!("packets of {size} bytes"),
                None => format!("packets of up to {} bytes", layout.max),
            },
        }
    }

    /// Returns whether messages are packets, which need a line that carries 8-bit bytes.
    pub fn is_binary(&self) -> bool {
        matches!(self.framing, Framing::Packet(_))
    }

    /// Returns whether messages have a sequence number that replies repeat.
    pub fn has_sequence(&self) -> bool {
        matches!(&self.framing, Framing::Packet(layout) if layout.sequence.is_some())
    }

    /// Returns whether damaged messages can be detected.
    pub fn has_checksum(&self) -> bool {
        matches!(&self.framing, Framing::Packet(layout) if layout.checksum.is_some())
    }

    /// Returns every `runs` message of the file with examples of its arguments, covering all
    /// choices, and the message's location in the file (`FILE:LINE: field`). A caller that has the
    /// device's command table can then check that these commands exist.
    pub fn all_runs(&self) -> &[(String, String)] {
        &self.runs
    }

    /// Creates a cutter for one direction.
    pub fn cutter(&self, direction: Direction) -> Cutter {
        match &self.framing {
            Framing::Scpi(_) => Cutter::scpi(),
            Framing::Line(ends) => Cutter::lines(ends.clone(), direction),
            Framing::Packet(layout) => Cutter::packets(layout.clone(), direction),
        }
    }

    /// Returns whether the device echoes received lines; see [`Self::echoed`].
    pub fn echo(&self) -> bool {
        self.echo
    }

    /// Returns the echo of a received line, including its line end.
    pub fn echoed(&self, message: &[u8]) -> Vec<u8> {
        match &self.framing {
            Framing::Scpi(ends) | Framing::Line(ends) => {
                [message, ends.to_host.as_bytes()].concat()
            }
            Framing::Packet(_) => message.to_vec(),
        }
    }

    /// Returns the messages that the device sends after power-on, in order of time.
    pub fn boot(&self) -> &[Boot] {
        &self.boot
    }

    /// Returns the operations that a host performs in this dialect.
    pub fn host(&self) -> &HostUse {
        &self.host
    }

    /// Returns the name of a command for error messages: its header in SCPI, else its name in the
    /// file.
    pub fn label(&self, command: &str) -> String {
        let header = self.command(command).filter(|_| self.is_scpi());
        let text = header.and_then(|command| match command.line.parts.first()? {
            Part::Text(text) => Some(text.trim()),
            Part::Field(_) => None,
        });
        text.unwrap_or(command).to_owned()
    }

    /// Returns the names of the commands.
    pub fn commands(&self) -> impl Iterator<Item = &str> {
        self.commands.iter().map(|command| command.name.as_str())
    }

    /// Returns how a host reads a command's long answer in pieces; `None` if the answer comes in one
    /// message.
    pub fn chunk(&self, command: &str) -> Option<&Chunk> {
        self.command(command)?.chunk.as_ref()
    }

    /// Returns whether the device answers a command; SCPI answers only queries.
    pub fn is_answered(&self, command: &str) -> bool {
        match (&self.framing, self.command(command)) {
            (Framing::Packet(_), found) => found.is_some(),
            (_, found) => found.is_some_and(|command| !command.reply.is_empty()),
        }
    }

    pub(super) fn command(&self, name: &str) -> Option<&Command> {
        self.commands.iter().find(|command| command.name == name)
    }
}
