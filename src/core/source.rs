//! TOML text with its name, so that every complaint about it carries file, line and field.

use crate::error::{Error, Result};
use crate::file;
use serde::de::DeserializeOwned;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use toml::de::{DeTable, DeValue};

/// Larger than any profile, scene or manifest; a file beyond it is refused unread.
const MAX_BYTES: u64 = 8 << 20;

/// A TOML document and where it came from.
pub struct TomlSource {
    text: String,
    place: String,
}

impl TomlSource {
    /// Wraps text; `place` stands for the file in messages.
    pub fn new(text: &str, place: &str) -> Self {
        Self {
            text: text.to_owned(),
            place: place.to_owned(),
        }
    }

    /// Reads a file of at most 8 MiB of UTF-8.
    ///
    /// # Errors
    /// What the system refuses, a larger file, or bytes that are not UTF-8.
    pub fn read(path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let bytes = file::read(path, MAX_BYTES)?;
        let text = String::from_utf8(bytes)
            .map_err(|e| Error::input(&place, e, "a text file in UTF-8"))?;
        Ok(Self { text, place })
    }

    /// The name in messages.
    pub fn place(&self) -> &str {
        &self.place
    }

    /// Whether the document has a value of this name at its top; not where it is no document.
    pub fn has(&self, key: &str) -> bool {
        DeTable::parse(&self.text).is_ok_and(|root| root.get_ref().contains_key(key))
    }

    /// Reads the document into a type.
    ///
    /// # Errors
    /// Syntax, unknown fields and wrong types, with the line.
    pub fn deserialize<T: DeserializeOwned>(&self) -> Result<T> {
        toml::from_str(&self.text).map_err(|e| {
            let line = e.span().map_or(1, |span| self.line_of(span.start));
            let message = e.message().trim_end().replace('\n', " ");
            // Some know what is allowed.
            let (found, allowed) = message.split_once("; allowed: ").unwrap_or((
                &message,
                "what the README and the files in device-profiles show",
            ));
            Error::input(format!("{}:{line}", self.place), found, allowed)
        })
    }

    /// An error about the value at `path`, such as `frame[3].pattern.period_px`, with the line
    /// that it (or the nearest table around it) stands on.
    pub fn violation(&self, path: &str, found: impl Display, allowed: impl Display) -> Error {
        Error::input(self.place_of(path), found, allowed)
    }

    /// Where that value stands, as messages say it: `FILE:LINE: PATH`.
    pub fn place_of(&self, path: &str) -> String {
        let line = self.line_of(self.offset_of(path).unwrap_or(0));
        format!("{}:{line}: {path}", self.place)
    }

    fn line_of(&self, offset: usize) -> usize {
        let end = offset.min(self.text.len());
        1 + self.text.as_bytes()[..end]
            .iter()
            .filter(|&&b| b == b'\n')
            .count()
    }

    fn offset_of(&self, path: &str) -> Option<usize> {
        let root = DeTable::parse(&self.text).ok()?;
        let mut table = root.get_ref();
        let mut offset = None;
        for step in path.split('.') {
            let (key, indices) = step.split_once('[').unwrap_or((step, ""));
            let Some((name, value)) = table.get_key_value(key) else {
                break;
            };
            offset = Some(name.span().start);
            let mut value = value;
            for index in indices.split(']').filter(|s| !s.is_empty()) {
                let index: usize = index.trim_start_matches('[').parse().ok()?;
                let DeValue::Array(array) = value.get_ref() else {
                    break;
                };
                value = array.get(index)?;
                offset = Some(value.span().start);
            }
            match value.get_ref() {
                DeValue::Table(inner) => table = inner,
                _ => break,
            }
        }
        offset
    }
}

/// Loads the built-in document of a name, or else a file; also returns the file's folder, which is
/// empty for a built-in one. `built_in` lists names and texts; `kind` names the kind of document in
/// messages.
///
/// # Errors
/// Returns an error if the name is neither built in nor a file, or if the file cannot be read.
pub fn load(
    name_or_path: &str,
    built_in: &[(&str, &str)],
    kind: &str,
) -> Result<(TomlSource, PathBuf)> {
    if let Some((name, text)) = built_in.iter().find(|(name, _)| *name == name_or_path) {
        let place = format!("built-in {kind} {name}");
        return Ok((TomlSource::new(text, &place), PathBuf::new()));
    }
    let path = Path::new(name_or_path);
    if !path.is_file() {
        let names: Vec<_> = built_in.iter().map(|(name, _)| *name).collect();
        return Err(Error::input(
            format!("{kind} {name_or_path:?}"),
            "neither a built-in name nor a file",
            format!("{} or the path of a TOML file", names.join(", ")),
        ));
    }
    let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
    Ok((TomlSource::read(path)?, folder))
}
