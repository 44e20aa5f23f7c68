//! Dialects: the language of a device's control port, described by a file.
//!
//! The device's own language is SCPI ([`crate::scpi`]). A dialect replaces it: it defines how bytes
//! are split into messages, the commands, the device's own messages that each stands for, replies,
//! unsolicited messages, and how a host performs the operations of a scan. Both sides read the same
//! file, so the emulated device speaks it, and a physical device that speaks it needs no code in
//! the host. Everything here is a pure function of its arguments: nothing blocks, and all input is
//! bounded.
//!
//! ```text
//!  host: request --bytes--> cutter --message--> asked --> runs --> firmware
//!        reply <--message-- cutter <--bytes-- answer, refusal <-- answers, errors
//! ```
//!
//! Without a checksum a bit error in a number goes unnoticed: with line dialects and packets
//! without checksums, the host must read back what it has set.
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

/// A validated dialect.
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
    /// Examples of the firmware's messages, each with its location in the file.
    runs: Vec<(String, String)>,
}

impl Dialect {
    /// Loads a built-in dialect by its name, or else a file by its path.
    ///
    /// # Errors
    /// Returns an error if the name is neither built in nor a file, if the file cannot be read, or
    /// if [`Self::parse`] fails.
    pub fn load(name_or_path: &str) -> Result<Self> {
        Self::from_source(&builtin::source(name_or_path)?)
    }

    /// Makes the path of a dialect file absolute, and returns a built-in name unchanged.
    pub fn from_anywhere(name_or_path: &str) -> String {
        let absolute = std::path::absolute(name_or_path)
            .ok()
            .filter(|path| path.is_file() && !Self::names().any(|name| name == name_or_path));
        absolute
            .and_then(|path| path.to_str().map(str::to_owned))
            .unwrap_or_else(|| name_or_path.to_owned())
    }

    /// Parses and checks a dialect; `place` is the file name used in messages.
    ///
    /// # Errors
    /// Returns an error with its line on a syntax error, an unknown field, a wrong type or an
    /// inconsistency.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        Self::from_source(&TomlSource::new(text, place))
    }

    /// Reads and checks a dialect.
    ///
    /// # Errors
    /// Returns an error under the same conditions as [`Self::parse`].
    pub fn from_source(source: &TomlSource) -> Result<Self> {
        check::dialect(&source.deserialize()?, source)
    }

    /// Returns the JSON Schema of dialect files, with these settings of the generator.
    #[cfg(feature = "schema")]
    #[doc(hidden)]
    pub fn schema(settings: schemars::generate::SchemaSettings) -> schemars::Schema {
        settings
            .into_generator()
            .into_root_schema_for::<file::File>()
    }

    /// Returns the names of the built-in dialects.
    pub fn names() -> impl Iterator<Item = &'static str> {
        builtin::DIALECTS.iter().map(|(name, _)| *name)
    }

    /// Returns the text of a built-in dialect's file.
    pub fn text(name: &str) -> Option<&'static str> {
        let found = builtin::DIALECTS.iter().find(|(known, _)| *known == name);
        found.map(|(_, text)| *text)
    }

    /// Returns the name used to select it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the one-line description for listings.
    pub fn description(&self) -> &str {
        &self.description
    }

    /// Returns whether it is the device's native grammar (IEEE 488.2), so that messages pass
    /// through unchanged.
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

    /// Returns whether messages are packets, which need 8-bit bytes.
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
    /// choices, and its location in the file (`FILE:LINE: field`), so that a caller with the
    /// device's command table can check that these commands exist.
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

    /// Returns whether the device echoes what it receives: see [`Self::echoed`].
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

    /// Returns the messages after power-on, in time order.
    pub fn boot(&self) -> &[Boot] {
        &self.boot
    }

    /// Returns the host's operations.
    pub fn host(&self) -> &HostUse {
        &self.host
    }

    /// Returns whether another dialect performs an operation with the same messages, regardless of
    /// command names.
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

    /// Returns the names of the commands.
    pub fn commands(&self) -> impl Iterator<Item = &str> {
        self.commands.iter().map(|command| command.name.as_str())
    }

    /// Returns how a command's long answer is read in pieces; `None` if it comes in one message.
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

    fn command(&self, name: &str) -> Option<&Command> {
        self.commands.iter().find(|command| command.name == name)
    }
}
