//! Building blocks to check the values in a TOML document. A violation is reported with the line,
//! the value found and the allowed range.

use crate::error::{Error, Result};
use crate::repair::MAX_COUNTED;
use crate::source::TomlSource;
use serde::de::DeserializeOwned;
use std::cell::RefCell;
use std::fmt::{Display, LowerExp};
use std::ops::RangeInclusive;

/// Checks values read from a document and reports violations by file, line and field. Values out of
/// range are collected. Any other violation ends the section (see [`Self::section`]) in which it is
/// found.
pub struct Check<'a> {
    /// The document the values come from.
    pub source: &'a TomlSource,
    /// Values out of range in this section, without the sections nested in it.
    errors: RefCell<Vec<Error>>,
    /// Violations in the sections nested in this one.
    inside: RefCell<Vec<Error>>,
}

impl<'a> Check<'a> {
    /// Checks the values of a document.
    ///
    /// # Errors
    /// Returns all violations that were found, the first 20 of them by line.
    #[cfg(test)]
    pub fn all(source: &'a TomlSource, check: impl FnOnce(&Self) -> Result<()>) -> Result<()> {
        let errors = Self::errors_of(source, check);
        match errors.is_empty() {
            true => Ok(()),
            false => Err(source.in_order(errors, false)),
        }
    }

    /// Deserialises a document and checks its values.
    ///
    /// # Errors
    /// Returns all errors that were found, the first 20 of them by line. If the document has an error
    /// other than a missing text field, its values are not checked.
    pub fn read<T: DeserializeOwned>(
        source: &'a TomlSource,
        check: impl FnOnce(&mut T, &Self) -> Result<()>,
    ) -> Result<T> {
        let (mut value, mut errors) = match source.deserialized()? {
            Ok(value) => (value, Vec::new()),
            Err(mut faults) => {
                let errors = source.errors(&faults);
                match faults.mended.take() {
                    Some(mended) => (mended, errors),
                    None => return Err(source.in_order(errors, !faults.is_complete)),
                }
            }
        };
        errors.extend(Self::errors_of(source, |all| check(&mut value, all)));
        match errors.is_empty() {
            true => Ok(value),
            false => Err(source.in_order(errors, false)),
        }
    }

    /// Checks a part of the document whose violations do not affect other checks. Returns `true` if
    /// the part has no violation. After 200 violations, further parts are not checked.
    pub fn section(&self, check: impl FnOnce(&Self) -> Result<()>) -> bool {
        if self.inside.borrow().len() >= MAX_COUNTED {
            return false;
        }
        let errors = Self::errors_of(self.source, check);
        let is_valid = errors.is_empty();
        self.inside.borrow_mut().extend(errors);
        is_valid
    }

    fn errors_of(source: &'a TomlSource, check: impl FnOnce(&Self) -> Result<()>) -> Vec<Error> {
        let section = Self {
            source,
            errors: RefCell::default(),
            inside: RefCell::default(),
        };
        let ended = check(&section).err();
        let own = section.errors.into_inner().into_iter();
        own.chain(ended)
            .chain(section.inside.into_inner())
            .collect()
    }

    /// Ends the section if one of its values is out of range. Call this before checks that use
    /// several values together.
    ///
    /// # Errors
    /// Returns an error if a value of this section is out of range.
    pub fn in_range(&self) -> Result<()> {
        self.errors.borrow_mut().pop().map_or(Ok(()), Err)
    }

    /// Checks that a value lies in an inclusive range. NaN is outside every range.
    ///
    /// # Errors
    /// Values out of range are collected without an error. Returns an error with the line of `field`
    /// only if the section already has many of them.
    pub fn within<T>(&self, field: &str, value: T, range: RangeInclusive<T>) -> Result<()>
    where
        T: PartialOrd + Display + LowerExp + Copy,
    {
        self.within_for(field, value, range, "")
    }

    /// Checks that a value lies in an inclusive range; `reason`, such as " for camera.bits = 8", follows
    /// the range in the message.
    ///
    /// # Errors
    /// Returns the error of [`Self::within`].
    pub fn within_for<T>(
        &self,
        field: &str,
        value: T,
        range: RangeInclusive<T>,
        reason: &str,
    ) -> Result<()>
    where
        T: PartialOrd + Display + LowerExp + Copy,
    {
        // NaN is never contained in a range.
        if range.contains(&value) {
            return Ok(());
        }
        let (low, high) = (range.start(), range.end());
        let allowed = if low == high {
            format!("{low}{reason}")
        } else {
            format!("{low} to {high}{reason}")
        };
        // Use exponent notation for numbers that would print hundreds of digits.
        let plain = value.to_string();
        let found = if plain.len() <= 24 {
            plain
        } else {
            format!("{value:e}")
        };
        let found = self.given(field, found);
        self.collect(self.source.violation(field, found, allowed))
    }

    /// Returns the value of a field for a message; a value that the document does not give is marked as
    /// the default.
    pub fn given(&self, field: &str, value: impl Display) -> String {
        match self.source.has(field) {
            true => value.to_string(),
            false => format!("{value}, the default"),
        }
    }

    /// Adds a violation of this section.
    ///
    /// # Errors
    /// Returns the violation as an error if the section has collected many.
    pub fn collect(&self, violation: Error) -> Result<()> {
        let mut errors = self.errors.borrow_mut();
        if errors.len() + 1 >= MAX_COUNTED {
            return Err(violation);
        }
        errors.push(violation);
        Ok(())
    }

    /// Checks that every value of a list lies in an inclusive range; reports the first value that
    /// does not.
    ///
    /// # Errors
    /// Returns the error of [`Self::within`].
    pub fn all_within(
        &self,
        field: &str,
        values: &[f64],
        range: RangeInclusive<f64>,
    ) -> Result<()> {
        // NaN is never contained in a range.
        match values.iter().find(|value| !range.contains(value)) {
            Some(&value) => self.within(field, value, range),
            None => Ok(()),
        }
    }

    /// Checks a condition on values that are in range.
    ///
    /// # Errors
    /// Returns an error if a value of this section is out of range, or, with the line of `field`, the
    /// value found and what is allowed, if `ok` is false.
    pub fn that(
        &self,
        ok: bool,
        field: &str,
        found: impl Display,
        allowed: impl Display,
    ) -> Result<()> {
        self.in_range()?;
        if ok {
            Ok(())
        } else {
            Err(self.source.violation(field, found, allowed))
        }
    }
}

/// Checks that a text is a valid name: 1 to 64 ASCII letters, digits, `-`, `_` or `.`.
///
/// # Errors
/// Returns an error with the line of `field` if the text is not a valid name.
pub fn name(text: &str, field: &str, check: &Check<'_>) -> Result<()> {
    let ok = (1..=64).contains(&text.len())
        && text
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.'));
    check.that(
        ok,
        field,
        format!("{text:?}"),
        "1 to 64 letters, digits, '-', '_' or '.'",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_collected_and_sections_are_independent() {
        let text = "a = 1\nb = nan\n[c]\nd = 4\n";
        let source = TomlSource::new(text, "m.toml");
        let message = Check::all(&source, |check| {
            let fine = check.section(|check| {
                check.within("c.d", 4, 5..=6)?;
                check.that(false, "c", "not reached", "")
            });
            assert!(!fine);
            check.that(true, "a", "sections inside do not matter", "")?;
            assert!(check.section(|check| check.that(true, "c", "fine", "")));
            check.within("a", 1, 2..=3)?;
            check.within("b", f64::NAN, 0.0..=1.0)?;
            check.in_range()?;
            unreachable!("values are out of range")
        });
        let message = message.unwrap_err().to_string();
        let places: Vec<_> = message
            .lines()
            .filter_map(|line| line.split(": ").next())
            .collect();
        assert_eq!(places, ["m.toml:1", "m.toml:2", "m.toml:4"], "{message}");
        Check::all(&source, |check| check.within("a", 1, 0..=3)).unwrap();
    }

    #[test]
    fn the_number_of_violations_is_limited() {
        let source = TomlSource::new("a = 1", "m.toml");
        let all = Check::all(&source, |check| {
            (0..100).try_for_each(|_| check.within("a", 1, 2..=3))
        });
        let message = all.unwrap_err().to_string();
        assert_eq!(message.lines().count(), 21);
        assert!(message.ends_with("\nand 80 further errors"), "{message}");
        let mut checked = 0;
        let all = Check::all(&source, |check| {
            for _ in 0..1000 {
                check.section(|check| {
                    checked += 1;
                    check.within("a", 1, 2..=3)
                });
            }
            Ok(())
        });
        assert_eq!(checked, MAX_COUNTED);
        let message = all.unwrap_err().to_string();
        let end = "\nand at least 180 further errors";
        assert!(message.ends_with(end), "{message}");
    }

    #[test]
    fn defaults_are_called_so_and_a_missing_name_hides_nothing() {
        #[derive(Debug, serde::Deserialize)]
        #[expect(dead_code, reason = "only read")]
        struct Document {
            a: i32,
            name: String,
        }
        let source = TomlSource::new("a = 7\n", "m.toml");
        let read = Check::read(&source, |document: &mut Document, check| {
            check.within("a", document.a, 2..=3)?;
            check.within("b", 5, 2..=3)
        });
        let message = read.unwrap_err().to_string();
        let expected = [
            "m.toml:1: missing field `name`; expected the required field `name`",
            "m.toml:1: a: 7; expected 2 to 3",
            "m.toml:1: b: 5, the default; expected 2 to 3",
        ];
        assert_eq!(message.lines().collect::<Vec<_>>(), expected);
    }
}
