//! Dialects: how a device's control port talks, as a file.
//!
//! The device's own language is SCPI ([`crate::scpi`]). A dialect is another one in its
//! place: how bytes are cut into messages, which commands there are, which of the device's own
//! messages each stands for, how it is answered, what is said unasked; and how a host does what a
//! scan needs. Both halves read the same file, so the emulated device speaks it, and a physical
//! device that speaks it needs no code in the host. Everything here is a function of its arguments:
//! nothing waits, and what comes off a wire is bounded.
//!
//! ```text
//!  host: request --bytes--> cutter --message--> asked --> runs --> firmware
//!        reply <--message-- cutter <--bytes-- answer, refusal <-- answers, errors
//! ```
//!
//! Without a checksum a bit error in a number is another number: dialects of plain lines and of
//! packets without checksums leave it to the host to read back what it has set.
//!
#![doc = include_str!("guide.md")]

mod builtin;
mod check;
mod checksum;
mod command;
mod cutter;
mod device;
mod field;
mod file;
mod host;
mod overlap;
mod packet;
mod refusal;
mod template;
#[cfg(test)]
mod tests;
mod uses;
mod value;
mod word;

pub use cutter::{Cut, Cutter, Direction};
pub use uses::{Chunk, Gather, HostUse, MAX_CHUNKED_BYTES, Operation, Step};
pub use value::{Asked, Boot, Event, Head, Reply, Value, WireError};

use command::{Command, Errors, Framing, LineEnds};
use phasmid_core::error::Result;
use phasmid_core::source::TomlSource;
use template::Template;

/// A dialect, checked.
#[derive(Debug, Clone)]
pub struct Dialect {
    name: String,
    description: String,
    framing: Framing,
    echo: bool,
    commands: Vec<Command>,
    errors: Option<Errors>,
    events: Vec<(Event, Template)>,
    boot: Vec<Boot>,
    host: HostUse,
    /// Examples of the firmware's messages, each with its place in the file.
    runs: Vec<(String, String)>,
}

impl Dialect {
    /// A shipped dialect by its name, or else a file by its path.
    ///
    /// # Errors
    /// A name that is neither, unreadable files, and all that [`Self::parse`] refuses.
    pub fn load(name_or_path: &str) -> Result<Self> {
        Self::from_source(&builtin::source(name_or_path)?)
    }

    /// Reads and checks a dialect from text; `place` stands for the file in messages.
    ///
    /// # Errors
    /// Syntax, unknown fields, wrong types, and whatever contradicts itself, each with its line.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        Self::from_source(&TomlSource::new(text, place))
    }

    /// Reads and checks a dialect.
    ///
    /// # Errors
    /// As [`Self::parse`].
    pub fn from_source(source: &TomlSource) -> Result<Self> {
        check::dialect(&source.deserialize()?, source)
    }

    /// Names of the shipped dialects.
    pub fn names() -> impl Iterator<Item = &'static str> {
        builtin::DIALECTS.iter().map(|(name, _)| *name)
    }

    /// The file of a shipped dialect.
    pub fn text(name: &str) -> Option<&'static str> {
        let found = builtin::DIALECTS.iter().find(|(known, _)| *known == name);
        found.map(|(_, text)| *text)
    }

    /// Name by which it is chosen.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// One line for listings.
    pub fn description(&self) -> &str {
        &self.description
    }

    /// Whether the device's own grammar is spoken (IEEE 488.2), so that its messages pass through.
    pub fn is_scpi(&self) -> bool {
        matches!(self.framing, Framing::Scpi(_))
    }

    /// How messages are told from each other, in words.
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

    /// Whether messages are packets, whose bytes have all of their bits.
    pub fn is_binary(&self) -> bool {
        matches!(self.framing, Framing::Packet(_))
    }

    /// Whether messages have a number that a reply repeats.
    pub fn has_sequence(&self) -> bool {
        matches!(&self.framing, Framing::Packet(layout) if layout.sequence.is_some())
    }

    /// Whether damaged messages are told from sound ones.
    pub fn has_checksum(&self) -> bool {
        matches!(&self.framing, Framing::Packet(layout) if layout.checksum.is_some())
    }

    /// Every `runs` message of the file with examples of its arguments, all choices among them, and
    /// its place in the file (`FILE:LINE: field`): whoever has the device's commands checks that
    /// they are there.
    pub fn all_runs(&self) -> &[(String, String)] {
        &self.runs
    }

    /// A fresh cutter for one direction.
    pub fn cutter(&self, direction: Direction) -> Cutter {
        match &self.framing {
            Framing::Scpi(_) => Cutter::scpi(),
            Framing::Line(ends) => Cutter::lines(ends.clone(), direction),
            Framing::Packet(layout) => Cutter::packets(layout.clone(), direction),
        }
    }

    /// Whether the device sends back what it receives: [`Self::echoed`] says how.
    pub fn echo(&self) -> bool {
        self.echo
    }

    /// A received line as it is sent back, with its end.
    pub fn echoed(&self, message: &[u8]) -> Vec<u8> {
        match &self.framing {
            Framing::Scpi(ends) | Framing::Line(ends) => {
                [message, ends.to_host.as_bytes()].concat()
            }
            Framing::Packet(_) => message.to_vec(),
        }
    }

    /// What the device says after power-on, in order of time.
    pub fn boot(&self) -> &[Boot] {
        &self.boot
    }

    /// The host's operations.
    pub fn host(&self) -> &HostUse {
        &self.host
    }

    /// Whether another dialect does an operation with the same words, whatever it calls them.
    pub fn does_alike(&self, other: &Self, operation: &str) -> bool {
        let words = |dialect: &Self| {
            let operation = dialect.host.get(operation)?;
            let commands = operation.steps.iter().map(|step| {
                let command = dialect.command(&step.command).cloned();
                command.map(|command| (command, step.args.clone()))
            });
            let mut commands: Vec<_> = commands.collect::<Option<_>>()?;
            for (command, _) in &mut commands {
                command.name.clear();
            }
            Some((commands, operation.result.clone()))
        };
        words(self) == words(other)
    }

    /// Names of the commands.
    pub fn commands(&self) -> impl Iterator<Item = &str> {
        self.commands.iter().map(|command| command.name.as_str())
    }

    /// How a command's long answer is read in pieces; `None` where it comes whole.
    pub fn chunk(&self, command: &str) -> Option<&Chunk> {
        self.command(command)?.chunk.as_ref()
    }

    /// Whether the device answers a command at all: SCPI does not answer an order.
    pub fn is_answered(&self, command: &str) -> bool {
        match (&self.framing, self.command(command)) {
            (Framing::Packet(_), found) => found.is_some(),
            (_, found) => found.is_some_and(|command| !command.reply.is_empty()),
        }
    }

    fn command(&self, name: &str) -> Option<&Command> {
        self.commands.iter().find(|command| command.name == name)
    }
}
