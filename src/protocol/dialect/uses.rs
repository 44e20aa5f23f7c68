//! Host operations in terms of a dialect's commands.

use super::{Event, Value};
use phasmid_core::error::{Error, Result};
use std::collections::BTreeMap;

/// The operations that the host performs on a device, as listed in the last table of the
/// [guide](super).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct HostUse {
    pub(super) operations: BTreeMap<String, Operation>,
    /// Further settings that the host reads back.
    pub(super) settings: BTreeMap<String, Operation>,
}

/// Each operation: its name, its inputs, whether it has a result.
pub(super) const OPERATIONS: [(&str, &[&str], bool); 18] = [
    ("identify", &[], true),
    ("list", &[], true),
    ("select", &["name"], false),
    ("selected", &[], true),
    ("manifest", &[], true),
    ("calibration", &[], true),
    ("source", &[], true),
    ("quiet", &[], false),
    ("restore", &["source"], false),
    ("light_on", &[], false),
    ("arm", &[], false),
    ("trigger", &[], false),
    ("complete", &[], false),
    ("exposure", &["exposure"], false),
    ("last_id", &[], true),
    ("errors", &[], true),
    ("mark", &["mark"], false),
    ("marked", &[], true),
];

/// Operations whose result is a setting of the device, in the order in which the host queries them.
pub(super) const REPORTS: [&str; 2] = ["selected", "source"];

/// Operations required for a scan.
const NEEDED: [&str; 1] = ["trigger"];

impl HostUse {
    /// Returns an operation by name; `None` if the dialect lacks it.
    pub fn get(&self, operation: &str) -> Option<&Operation> {
        self.operations.get(operation)
    }

    /// Returns the settings that the host reads back before and after a run, each with its query:
    /// the operations `selected` and `source`, and the entries of the table `settings` in the file.
    pub fn settings(&self) -> impl Iterator<Item = (&str, &Operation)> {
        let reports = REPORTS.into_iter();
        let reports = reports.filter_map(|name| Some((name, self.get(name)?)));
        let further = self.settings.iter();
        reports.chain(further.map(|(name, operation)| (name.as_str(), operation)))
    }

    /// Returns the query of a setting; `None` if the dialect lacks it.
    pub fn setting(&self, name: &str) -> Option<&Operation> {
        self.settings()
            .find_map(|(known, operation)| (known == name).then_some(operation))
    }

    /// Returns whether a setting may have this value before a run.
    pub fn allows(&self, setting: &str, value: &str) -> bool {
        let allowed = self.setting(setting).map_or(&[][..], |s| &s.allowed);
        allowed.is_empty() || allowed.iter().any(|word| word.eq_ignore_ascii_case(value))
    }

    /// Returns the names of the operations that the dialect supports.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        let all = OPERATIONS.iter().map(|(name, ..)| *name);
        all.filter(|name| self.operations.contains_key(*name))
    }

    /// Returns the names of operations that a scan requires and the dialect lacks.
    pub fn needed(&self) -> impl Iterator<Item = &'static str> {
        self.missing().filter(|name| NEEDED.contains(name))
    }

    /// Returns the names of operations that the dialect lacks.
    pub fn missing(&self) -> impl Iterator<Item = &'static str> {
        let all = OPERATIONS.iter().map(|(name, ..)| *name);
        all.filter(|name| !self.operations.contains_key(*name))
    }
}

/// The steps of an operation, in order. Each step is a command whose answer is awaited.
#[derive(Debug, Clone, PartialEq)]
pub struct Operation {
    /// Steps in order.
    pub steps: Vec<Step>,
    /// Template of the result, with `{value}` placeholders for values of the answers.
    pub(super) result: Option<String>,
    /// Results that a setting may have before a run; empty if all are allowed.
    pub(super) allowed: Vec<String>,
}

impl Operation {
    /// Returns the result from the values of all answers; a template of a single value keeps that
    /// value's type. `None` if the operation has no result or a value is missing.
    pub fn result(&self, values: &[(String, Value)]) -> Option<Value> {
        let template = self.result.as_deref()?;
        let find = |name: &str| values.iter().rev().find(|(n, _)| n == name).map(|(_, v)| v);
        if let Some(name) = template.strip_prefix('{').and_then(|t| t.strip_suffix('}'))
            && !name.contains(['{', '}'])
        {
            return find(name).cloned();
        }
        let mut text = String::new();
        let mut rest = template;
        while let Some((before, after)) = rest.split_once('{') {
            let (name, after) = after.split_once('}')?;
            text.push_str(before);
            text.push_str(&find(name)?.to_string());
            rest = after;
        }
        text.push_str(rest);
        Some(Value::Text(text))
    }
}

/// One command of an operation.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// Name of the command.
    pub command: String,
    /// Arguments of the command.
    pub(super) args: Vec<(String, Argument)>,
}

/// An argument of a step.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Argument {
    /// The operation's input with this name.
    Input(String),
    /// A constant from the dialect file.
    Literal(Value),
}

impl Step {
    /// Returns the arguments with the operation's inputs inserted.
    ///
    /// # Errors
    /// Returns an error if an input is missing.
    pub fn args<'a>(&'a self, inputs: &[(&str, Value)]) -> Result<Vec<(&'a str, Value)>> {
        let value = |argument: &Argument| match argument {
            Argument::Literal(value) => Ok(value.clone()),
            Argument::Input(name) => inputs
                .iter()
                .find(|(input, _)| input == name)
                .map(|(_, value)| value.clone())
                .ok_or_else(|| Error::device(format!("{}: no input {name}", self.command))),
        };
        let args = self.args.iter();
        args.map(|(name, argument)| Ok((name.as_str(), value(argument)?)))
            .collect()
    }
}

/// Describes a command whose answer is longer than a message. The host repeats the command with
/// increasing offset until it has received all data.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Chunk {
    /// Name of the argument that holds the offset to read from, in bytes.
    pub offset: String,
    /// Name of the reply value that holds the next bytes.
    pub data: String,
    /// Name of the reply value that holds the total number of bytes.
    pub total: String,
    /// Name of the reply value that holds the CRC-32 (IEEE 802.3) of all bytes, if the dialect has
    /// one.
    pub check: Option<String>,
}

/// Maximum size in bytes of an answer reassembled from pieces.
pub const MAX_CHUNKED_BYTES: usize = 8 << 20;

/// Reassembles the pieces of a long answer.
#[derive(Debug, Clone)]
pub struct Gather<'a> {
    chunk: &'a Chunk,
    bytes: Vec<u8>,
    /// Total length in bytes, and checksum if the dialect has one, as given with the first piece.
    whole: Option<(usize, Option<u32>)>,
}

impl<'a> Gather<'a> {
    /// Returns a `Gather` without any pieces.
    pub fn new(chunk: &'a Chunk) -> Self {
        Self {
            chunk,
            bytes: Vec::new(),
            whole: None,
        }
    }

    /// Returns the argument that requests the next piece.
    pub fn ask(&self) -> (&'a str, Value) {
        (&self.chunk.offset, Value::Number(self.bytes.len() as f64))
    }

    /// Adds a piece. After the last piece, returns the whole answer.
    ///
    /// # Errors
    /// Returns an error if a piece does not fit the previous ones, the size exceeds
    /// [`MAX_CHUNKED_BYTES`] or the checksum does not match.
    pub fn take(&mut self, values: &[(String, Value)]) -> Result<Option<Vec<u8>>> {
        self.add(values).map_err(Error::device)
    }

    fn add(&mut self, values: &[(String, Value)]) -> Result<Option<Vec<u8>>, String> {
        let find = |name: &str| {
            let found = values.iter().find(|(n, _)| n == name).map(|(_, v)| v);
            found.ok_or_else(|| format!("a piece without {name}"))
        };
        let number = |name: &str| match find(name)? {
            Value::Number(number) => Ok(*number as u64),
            _ => Err(format!("a piece whose {name} is not a number")),
        };
        let total = number(&self.chunk.total)? as usize;
        let check = match &self.chunk.check {
            Some(name) => Some(number(name)? as u32),
            None => None,
        };
        let Value::Bytes(data) = find(&self.chunk.data)? else {
            return Err(format!("a piece whose {} is not bytes", self.chunk.data));
        };
        if total > MAX_CHUNKED_BYTES {
            return Err(format!(
                "{total} bytes in all, expected at most {MAX_CHUNKED_BYTES}"
            ));
        }
        if self.whole.is_some_and(|whole| whole != (total, check)) {
            return Err("pieces of different transfers".to_owned());
        }
        self.whole = Some((total, check));
        let left = total.saturating_sub(self.bytes.len());
        if data.len() > left || (data.is_empty() && left > 0) {
            return Err(format!(
                "a piece of {} bytes with {left} bytes left",
                data.len()
            ));
        }
        self.bytes.extend_from_slice(data);
        if self.bytes.len() < total {
            return Ok(None);
        }
        let bytes = std::mem::take(&mut self.bytes);
        if check.is_some_and(|check| check != crc32fast::hash(&bytes)) {
            return Err("the checksum of the whole transfer does not match".to_owned());
        }
        Ok(Some(bytes))
    }
}

/// Events that a dialect can report, with their names in dialect files.
pub(super) const EVENTS: [(&str, Event); 4] = [
    ("booted", Event::Booted),
    ("exposed", Event::Exposed { index: 0, id: 0 }),
    ("done", Event::SequenceDone),
    ("missed", Event::TriggerMissed),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_guide_has_all_operations() {
        let rows = || include_str!("guide.md").lines();
        for (name, inputs, _) in OPERATIONS {
            let row = rows().find(|row| row.starts_with(&format!("| {name} |")));
            let row = row.unwrap_or_else(|| panic!("no row for {name}"));
            for input in inputs {
                assert!(row.contains(&format!("`{input}`")), "{row}");
            }
        }
    }
}
