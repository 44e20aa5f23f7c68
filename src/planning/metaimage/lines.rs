//! Lines `Key = Value`, found by key; some keys have several names.

use phasmid_core::error::{Error, Result};
use phasmid_geometry::file::{next_line, quoted};
use std::fmt::Display;
use std::path::Path;

/// The relevant lines, each with its line number.
pub(super) struct Lines<'a> {
    pub(super) place: String,
    lines: Vec<(usize, &'a str, &'a str)>,
}

impl<'a> Lines<'a> {
    /// Parses all lines; also returns the offset of the data that follows.
    pub(super) fn read(bytes: &'a [u8], path: &Path) -> Result<(Self, u64)> {
        let mut lines = Self {
            place: path.display().to_string(),
            lines: Vec::new(),
        };
        let mut rest = bytes;
        let mut number = 0;
        while let Some(line) = next_line(&mut rest) {
            number += 1;
            let text = str::from_utf8(line).ok();
            let split = text.and_then(|line| line.split_once('='));
            let Some((key, value)) = split.map(|(k, v)| (k.trim(), v.trim())) else {
                if line.trim_ascii().is_empty() {
                    continue;
                }
                return Err(Error::input(
                    format!("{}:{number}", lines.place),
                    quoted(line),
                    "a MetaImage header: lines `Key = Value`, the last of them ElementDataFile",
                ));
            };
            lines.lines.push((number, key, value));
            if key == "ElementDataFile" {
                return Ok((lines, (bytes.len() - rest.len()) as u64));
            }
        }
        Err(Error::input(
            format!("{}:{number}", lines.place),
            "no ElementDataFile",
            "a MetaImage header that ends with ElementDataFile",
        ))
    }

    /// Returns the value of a key that has several names.
    ///
    /// # Errors
    /// Returns an error if there are two different values.
    pub(super) fn any_of(&self, keys: &[&'static str]) -> Result<Option<(&'static str, &'a str)>> {
        let mut found: Option<(&'static str, &'a str)> = None;
        for &(_, key, value) in &self.lines {
            let Some(&key) = keys.iter().find(|&&k| k == key) else {
                continue;
            };
            if let Some((_, before)) = found
                && before != value
            {
                let found = format!("{} after {}", shown(value), shown(before));
                return Err(self.wrong(key, found, "one value"));
            }
            found = Some((key, value));
        }
        Ok(found)
    }

    pub(super) fn get(&self, key: &'static str) -> Result<Option<&'a str>> {
        Ok(self.any_of(&[key])?.map(|(_, value)| value))
    }

    pub(super) fn needed(&self, key: &'static str) -> Result<&'a str> {
        self.get(key)?
            .ok_or_else(|| Error::input(&self.place, format!("no {key}"), "a line that sets it"))
    }

    /// Checks that a key, if present, has its only supported value.
    pub(super) fn is(&self, key: &str, wanted: &str) -> Result<()> {
        let same = |value: &str| value.eq_ignore_ascii_case(wanted);
        let mut all = self.lines.iter().filter(|(_, k, _)| *k == key);
        match all.find(|(_, _, value)| !same(value)) {
            Some((_, _, value)) => Err(self.wrong(key, shown(value), wanted)),
            None => Ok(()),
        }
    }

    pub(super) fn flag(&self, keys: &[&'static str]) -> Result<Option<bool>> {
        let Some((key, value)) = self.any_of(keys)? else {
            return Ok(None);
        };
        match value.bytes().next().map(|b| b.to_ascii_lowercase()) {
            // Same rule as MetaIO.
            Some(b't' | b'1') => Ok(Some(true)),
            Some(b'f' | b'0') => Ok(Some(false)),
            _ => Err(self.wrong(key, shown(value), "True or False")),
        }
    }

    pub(super) fn number<T: std::str::FromStr>(
        &self,
        key: &'static str,
        allowed: &str,
    ) -> Result<Option<T>> {
        let Some(value) = self.get(key)? else {
            return Ok(None);
        };
        match value.parse() {
            Ok(number) => Ok(Some(number)),
            Err(_) => Err(self.wrong(key, shown(value), allowed)),
        }
    }

    pub(super) fn numbers<T: std::str::FromStr, const N: usize>(
        &self,
        keys: &[&'static str],
    ) -> Result<Option<(&'static str, [T; N])>> {
        let Some((key, value)) = self.any_of(keys)? else {
            return Ok(None);
        };
        let parsed: Vec<T> = value
            .split_whitespace()
            .map_while(|word| word.parse().ok())
            .take(N + 1)
            .collect();
        let words = value.split_whitespace().count();
        match <[T; N]>::try_from(parsed) {
            Ok(numbers) if words == N => Ok(Some((key, numbers))),
            _ => Err(self.wrong(key, shown(value), format!("{N} numbers"))),
        }
    }

    /// Creates an error about a key's value, with its line.
    pub(super) fn wrong(&self, key: &str, found: impl Display, allowed: impl Display) -> Error {
        let line = self.lines.iter().rev().find(|(_, k, _)| *k == key);
        let line = line.map_or(1, |&(number, _, _)| number);
        Error::input(format!("{}:{line}: {key}", self.place), found, allowed)
    }
}

pub(super) fn shown(text: &str) -> String {
    quoted(text.as_bytes())
}
