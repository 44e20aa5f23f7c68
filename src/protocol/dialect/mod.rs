//! Dialects: the language of a device's control port, described by a file.
//!
//! The device's own language is SCPI ([`crate::scpi`]). A dialect replaces SCPI on the control port.
//! It defines how bytes are split into messages, the commands and the SCPI messages that each of
//! them runs, replies, unsolicited messages, and how a host performs the operations of a scan.
//! Device and host read the same file, so a physical device that speaks the dialect needs no extra
//! code in the host. Everything here is a pure function of its arguments: nothing blocks, and all
//! input is bounded.
//!
//! ```text
//!  host: request --bytes--> cutter --message--> asked --> runs --> firmware
//!        reply <--message-- cutter <--bytes-- answer, refusal <-- answers, errors
//! ```
//!
//! Without a checksum, a bit error in a number goes unnoticed. In line dialects, and with packets
//! without a checksum, the host must therefore read back the settings that it has made.
//!
#![doc = include_str!("guide.md")]

mod check;
mod checksum;
mod command;
mod cutter;
mod definition;
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

pub use cutter::{Cut, Cutter};
pub use definition::Dialect;
pub use uses::{Chunk, Gather, HostUse, MAX_CHUNKED_BYTES, Operation, Step};
pub use value::{Asked, Boot, Direction, Event, Head, Reply, Value, WireError};

use phasmid_core::error::{Error, Result};
use phasmid_core::source::TomlSource;
use std::path::Path;

/// Name and text of each built-in dialect.
const DIALECTS: [(&str, &str); 3] = [
    ("scpi", phasmid_device_profiles::DIALECTS_SCPI),
    ("dlpc350", phasmid_device_profiles::DIALECTS_DLPC350),
    ("okline", phasmid_device_profiles::DIALECTS_OKLINE),
];

impl Dialect {
    /// Loads a built-in dialect by its name or, if no built-in dialect has this name, a file by its
    /// path.
    ///
    /// # Errors
    /// Returns an error if the name is neither built in nor a file, if the file cannot be read, or
    /// if [`Self::parse`] fails.
    pub fn load(name_or_path: &str) -> Result<Self> {
        Self::from_source(&source(name_or_path)?)
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

    /// Returns the JSON Schema of dialect files, generated with these settings.
    #[cfg(feature = "schema")]
    #[doc(hidden)]
    pub fn schema(settings: schemars::generate::SchemaSettings) -> schemars::Schema {
        settings
            .into_generator()
            .into_root_schema_for::<file::File>()
    }

    /// Returns the names of the built-in dialects.
    pub fn names() -> impl Iterator<Item = &'static str> {
        DIALECTS.iter().map(|(name, _)| *name)
    }

    /// Returns the text of a built-in dialect's file.
    pub fn text(name: &str) -> Option<&'static str> {
        let found = DIALECTS.iter().find(|(known, _)| *known == name);
        found.map(|(_, text)| *text)
    }
}

/// Loads a built-in dialect or a file.
fn source(name_or_path: &str) -> Result<TomlSource> {
    if let Some((name, text)) = DIALECTS.iter().find(|(name, _)| *name == name_or_path) {
        return Ok(TomlSource::new(text, &format!("built-in dialect {name}")));
    }
    let path = Path::new(name_or_path);
    if !path.is_file() {
        let names: Vec<_> = DIALECTS.iter().map(|(name, _)| *name).collect();
        return Err(Error::input(
            format!("dialect {name_or_path:?}"),
            "neither a built-in name nor a file",
            format!("{} or the path of a TOML file", names.join(", ")),
        ));
    }
    TomlSource::read(path)
}
