//! TOML text with its file name, so that every error carries file, line and field.

use crate::error::{Error, Result};
use crate::file;
use crate::wording::{found_and_expected, nearest};
use serde::de::DeserializeOwned;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use toml::de::{DeTable, DeValue};

/// Size limit, larger than any valid profile, scene or manifest; a larger file is rejected without
/// being read.
const MAX_BYTES: u64 = 8 << 20;

/// A TOML document and its file name.
pub struct TomlSource {
    text: String,
    place: String,
}

impl TomlSource {
    /// Wraps text; `place` is used as the file name in messages.
    pub fn new(text: &str, place: &str) -> Self {
        Self {
            text: text.to_owned(),
            place: place.to_owned(),
        }
    }

    /// Reads a UTF-8 file of at most 8 MiB.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, is larger or is not valid UTF-8.
    pub fn read(path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let bytes = file::read(path, MAX_BYTES)?;
        let text = String::from_utf8(bytes)
            .map_err(|e| Error::input(&place, e, "a text file in UTF-8"))?;
        Ok(Self { text, place })
    }

    /// Returns the file name used in messages.
    pub fn place(&self) -> &str {
        &self.place
    }

    /// Returns whether the document has a top-level key of this name; false if it is not valid
    /// TOML.
    pub fn has(&self, key: &str) -> bool {
        DeTable::parse(&self.text).is_ok_and(|root| root.get_ref().contains_key(key))
    }

    /// Deserialises the document.
    ///
    /// # Errors
    /// Returns an error with the line for a syntax error, an unknown field or a wrong type.
    pub fn deserialize<T: DeserializeOwned>(&self) -> Result<T> {
        toml::from_str(&self.text).map_err(|e| {
            let line = e.span().map_or(1, |span| self.line_of(span.start));
            let message = e.message();
            let missing = message.strip_prefix("missing field ");
            let otherwise = missing.map_or_else(
                || "valid TOML".to_owned(),
                |name| format!("the required field {}", name.trim_end()),
            );
            let (found, expected) = found_and_expected(message, &otherwise);
            Error::input(format!("{}:{line}", self.place), found, expected)
        })
    }

    /// Creates an error about the value at `path`, such as `frame[3].pattern.period_px`, with the
    /// line of the value or of the closest enclosing table.
    pub fn violation(&self, path: &str, found: impl Display, allowed: impl Display) -> Error {
        Error::input(self.place_of(path), found, allowed)
    }

    /// Returns the location of the value at `path` as `FILE:LINE: PATH`.
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

/// Loads a built-in document by name, or else a file. Also returns the file's folder, which is
/// empty for a built-in document. `built_in` lists names and texts; `kind` names the kind of
/// document in messages.
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
        let suggestion = nearest(name_or_path, names.iter().copied())
            .map_or_else(String::new, |name| format!(" (did you mean {name}?)"));
        return Err(Error::input(
            format!("{kind} {name_or_path:?}"),
            format!("neither a built-in name nor a file{suggestion}"),
            format!("{} or the path of a TOML file", names.join(", ")),
        ));
    }
    let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
    Ok((TomlSource::read(path)?, folder))
}
