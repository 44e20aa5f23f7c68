//! TOML text with its file name, so that every error carries file, line and field.

use crate::deserializer::Fault;
use crate::error::{Error, Result};
use crate::file;
use crate::layers::Layers;
use crate::positions::{Part, Positions};
use crate::repair::{self, Faults, MAX_COUNTED};
pub use crate::setting::Setting;
use crate::wording::{found_and_expected, nearest};
use serde::de::DeserializeOwned;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Maximum size of a document in bytes. Any valid profile, scene or manifest is smaller; a larger
/// file is rejected without being read.
const MAX_BYTES: u64 = 8 << 20;

/// Maximum number of errors that are listed.
pub(crate) const MAX_LISTED: usize = 20;

/// Maximum number of documents in a chain in which each document extends the next.
const MAX_EXTENDED: usize = 16;

/// A TOML document and its file name, with the documents that it extends and settings on top of it.
pub struct TomlSource {
    layers: Layers,
    /// Positions of all values, computed when one is first needed; `None` if the document is not
    /// valid TOML.
    positions: OnceLock<Option<Positions>>,
}

impl From<Layers> for TomlSource {
    fn from(layers: Layers) -> Self {
        let positions = OnceLock::new();
        Self { layers, positions }
    }
}

impl TomlSource {
    /// Wraps text; `place` is used as the file name in messages.
    pub fn new(text: &str, place: &str) -> Self {
        Layers::of_document(text.to_owned(), place.to_owned()).into()
    }

    /// Reads a UTF-8 file of at most 8 MiB.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, is larger than 8 MiB or is not valid UTF-8.
    pub fn read(path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let bytes = file::read(path, MAX_BYTES)?;
        let text = String::from_utf8(bytes)
            .map_err(|e| Error::input(&place, e, "a text file in UTF-8"))?;
        Ok(Layers::of_document(text, place).into())
    }

    /// If this document has the key `extends`, adds the document that the key names: a built-in
    /// document, or a file relative to `folder`, this document's folder. `built_in` and `kind` are as
    /// for [`load`].
    ///
    /// # Errors
    /// Returns an error if the extended document cannot be read, or extends itself.
    pub fn extended(
        mut self,
        folder: &Path,
        built_in: &[(&str, &str)],
        kind: &str,
    ) -> Result<Self> {
        let mut folder = folder.to_path_buf();
        // Folder of the extended documents, relative to the folder of this document.
        let mut seen_from = PathBuf::new();
        let mut chain = self.place().to_owned();
        for _ in 0..MAX_EXTENDED {
            let Some((name, place)) = self.layers.extends()? else {
                return Ok(self);
            };
            let is_built_in = built_in.iter().any(|(known, _)| *known == name);
            let path = match is_built_in {
                true => name.clone(),
                false => folder.join(&name).display().to_string(),
            };
            let (base, _) = find(&path, built_in, kind).map_err(|error| error.at(&place))?;
            chain = format!("{chain}, which extends {}", base.place());
            // Skip built-in documents, which contain no file paths.
            let inner = Path::new(&name).parent();
            if let Some(inner) = inner.filter(|inner| *inner != Path::new("") && !is_built_in) {
                folder.push(inner);
                seen_from.push(inner);
            }
            self.layers
                .extend(base.layers, &seen_from.display().to_string());
            self.positions.take();
        }
        Err(Error::input(
            self.place(),
            format!(
                "documents that extend each other without end: {}",
                shortened(&chain)
            ),
            format!("at most {MAX_EXTENDED} documents, the last of which extends no other"),
        ))
    }

    /// Adds settings, which override the document.
    pub fn with(mut self, settings: &[Setting]) -> Self {
        for setting in settings {
            let place = setting.place();
            self.layers.set(&setting.path, &setting.value, place);
        }
        self.positions.take();
        self
    }

    /// Returns the file name used in messages.
    pub fn place(&self) -> &str {
        self.layers.place()
    }

    /// Returns whether the document, its base or a setting gives the value at `path`; false if
    /// the document is not valid TOML.
    pub fn has(&self, path: &str) -> bool {
        self.positions().is_some_and(|root| root.find(path).1)
    }

    /// Deserialises the document.
    ///
    /// # Errors
    /// Returns an error with the line for a syntax error. For a document up to 256 KiB, returns all
    /// unknown fields, missing fields and wrong types together, the first 20 of them by line.
    pub fn deserialize<T: DeserializeOwned>(&self) -> Result<T> {
        self.deserialized()?
            .map_err(|faults| self.in_order(self.errors(&faults), !faults.is_complete))
    }

    pub(crate) fn deserialized<T: DeserializeOwned>(&self) -> Result<Result<T, Faults<T>>> {
        Ok(repair::deserialize(
            self.layers.merged()?,
            self.layers.length(),
        ))
    }

    pub(crate) fn errors<T>(&self, faults: &Faults<T>) -> Vec<Error> {
        faults.list.iter().map(|fault| self.error(fault)).collect()
    }

    fn error(&self, fault: &Fault) -> Error {
        let message = fault.message.trim_end();
        let missing = message.strip_prefix("missing field ");
        let otherwise = missing.map_or_else(
            || "valid TOML".to_owned(),
            |name| format!("the required field {name}"),
        );
        let part = match missing {
            Some(_) => Part::Table,
            None if message.starts_with("unknown field ") => Part::Key,
            None if fault.is_of_list => Part::List,
            None => Part::Value,
        };
        let span = fault.span();
        let path = self.positions().map(|root| root.path_at(&span, part));
        let place = self.layers.place_at(span.start);
        let (found, expected) = found_and_expected(message, &otherwise);
        match path.filter(|path| !path.is_empty()) {
            Some(path) => Error::input(format!("{place}: {path}"), found, expected),
            None => Error::input(place, found, expected),
        }
    }

    /// Combines errors: lists the first errors by line and counts the others. If `is_cut` is set, more
    /// errors may exist, and the count is stated as a minimum.
    pub(crate) fn in_order(&self, mut errors: Vec<Error>, is_cut: bool) -> Error {
        errors.sort_by_cached_key(|error| match error {
            Error::Input { place, .. } => self.layers.rank(place),
            _ => (usize::MAX, 0),
        });
        let count = errors.len().saturating_sub(MAX_LISTED);
        if count > 0 {
            errors.truncate(MAX_LISTED);
            let is_least = is_cut || count + MAX_LISTED >= MAX_COUNTED;
            errors.push(Error::Further { count, is_least });
        }
        Error::several(errors)
    }

    fn positions(&self) -> Option<&Positions> {
        let find = || self.layers.merged().ok().map(|root| Positions::of(&root));
        self.positions.get_or_init(find).as_ref()
    }

    /// Returns the document as written.
    pub fn text(&self) -> &str {
        self.layers.text()
    }

    /// Returns the document, merged with the documents that it extends and with the settings, as
    /// TOML without comments.
    ///
    /// # Errors
    /// Returns an error with the line for a syntax error.
    pub fn to_toml(&self) -> Result<String> {
        let table: toml::Table = self.deserialize()?;
        Ok(table.to_string())
    }

    /// Creates an error about the value at `path`, such as `frame[3].pattern.period_px`, with the
    /// line of the value or of the closest enclosing table.
    pub fn violation(&self, path: &str, found: impl Display, allowed: impl Display) -> Error {
        Error::input(self.place_of(path), found, allowed)
    }

    /// Returns the location of the value at `path` as `FILE:LINE: PATH`.
    pub fn place_of(&self, path: &str) -> String {
        let position = self.positions().map_or(0, |root| root.find(path).0);
        format!("{}: {path}", self.layers.place_at(position))
    }
}

/// Loads a built-in document by name, or else a file, with the documents that it extends. Also returns
/// the file's folder, which is empty for a built-in document. `built_in` lists names and texts; `kind`
/// names the kind of document in messages.
///
/// # Errors
/// Returns an error if the name is neither built in nor a file, if the file cannot be read, or if
/// [`TomlSource::extended`] fails.
pub fn load(
    name_or_path: &str,
    built_in: &[(&str, &str)],
    kind: &str,
) -> Result<(TomlSource, PathBuf)> {
    let (source, folder) = find(name_or_path, built_in, kind)?;
    let source = source.extended(&folder, built_in, kind)?;
    Ok((source, folder))
}

/// Shortens a list of documents to its first four entries.
fn shortened(chain: &str) -> String {
    let first: Vec<&str> = chain.split(", ").take(4).collect();
    format!("{} ...", first.join(", "))
}

fn find(
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
        let found = match path.exists() {
            true => "neither a built-in name nor a regular file".to_owned(),
            false => format!("neither a built-in name nor a file{suggestion}"),
        };
        return Err(Error::input(
            format!("{kind} {name_or_path:?}"),
            found,
            format!("{} or the path of a TOML file", names.join(", ")),
        ));
    }
    let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
    Ok((TomlSource::read(path)?, folder))
}
