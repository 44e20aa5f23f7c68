//! Building blocks to check the values in a TOML document. A violation is reported with the line,
//! the value found and the allowed range.

use crate::error::{Error, Result};
use crate::source::TomlSource;
use std::cell::RefCell;
use std::fmt::{Display, LowerExp};
use std::ops::RangeInclusive;

/// Maximum number of violations that are reported together.
const MAX_ERRORS: usize = 20;

/// Checks values read from a document and reports violations by file, line and field. Values out of
/// range are collected; any other violation ends its section.
pub struct Check<'a> {
    /// The document the values come from.
    pub source: &'a TomlSource,
    /// Values out of range, of this section alone.
    errors: RefCell<Vec<Error>>,
    /// Violations in the sections inside.
    inside: RefCell<Vec<Error>>,
}

impl<'a> Check<'a> {
    /// Checks the values of a document.
    ///
    /// # Errors
    /// Returns all violations that were found, 20 at most.
    pub fn all(source: &'a TomlSource, check: impl FnOnce(&Self) -> Result<()>) -> Result<()> {
        let mut errors = Self::errors_of(source, check);
        errors.truncate(MAX_ERRORS);
        match errors.is_empty() {
            true => Ok(()),
            false => Err(Error::several(errors)),
        }
    }

    /// Checks a part of the document whose violations do not matter to the rest; returns whether it has
    /// none. After 20 violations the rest is not checked.
    pub fn section(&self, check: impl FnOnce(&Self) -> Result<()>) -> bool {
        if self.inside.borrow().len() >= MAX_ERRORS {
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

    /// Ends the section if one of its values is out of range, before they are used together.
    ///
    /// # Errors
    /// Returns an error if a value of this section is out of range.
    pub fn in_range(&self) -> Result<()> {
        self.errors.borrow_mut().pop().map_or(Ok(()), Err)
    }

    /// Checks that a value lies in an inclusive range. NaN is outside every range.
    ///
    /// # Errors
    /// Returns an error with the line of `field` if the value is out of range and the section has many
    /// such values.
    pub fn within<T>(&self, field: &str, value: T, range: RangeInclusive<T>) -> Result<()>
    where
        T: PartialOrd + Display + LowerExp + Copy,
    {
        // NaN is never contained in a range.
        if range.contains(&value) {
            return Ok(());
        }
        let (low, high) = (range.start(), range.end());
        let allowed = if low == high {
            low.to_string()
        } else {
            format!("{low} to {high}")
        };
        // Use exponent notation for numbers that would print hundreds of digits.
        let plain = value.to_string();
        let found = if plain.len() <= 24 {
            plain
        } else {
            format!("{value:e}")
        };
        let error = self.source.violation(field, found, allowed);
        let mut errors = self.errors.borrow_mut();
        if errors.len() + 1 >= MAX_ERRORS {
            return Err(error);
        }
        errors.push(error);
        Ok(())
    }

    /// Checks that every value of a list lies in an inclusive range; the first that does not is
    /// reported.
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
        let mut places: Vec<_> = message
            .lines()
            .filter_map(|line| line.split(": ").next())
            .collect();
        places.sort_unstable();
        assert_eq!(places, ["m.toml:1", "m.toml:2", "m.toml:4"], "{message}");
        Check::all(&source, |check| check.within("a", 1, 0..=3)).unwrap();
    }

    #[test]
    fn the_number_of_violations_is_limited() {
        let source = TomlSource::new("a = 1", "m.toml");
        let all = Check::all(&source, |check| {
            (0..100).try_for_each(|_| check.within("a", 1, 2..=3))
        });
        assert_eq!(all.unwrap_err().to_string().lines().count(), MAX_ERRORS);
        let mut checked = 0;
        let all = Check::all(&source, |check| {
            for _ in 0..100 {
                check.section(|check| {
                    checked += 1;
                    check.within("a", 1, 2..=3)
                });
            }
            Ok(())
        });
        assert_eq!(all.unwrap_err().to_string().lines().count(), MAX_ERRORS);
        assert_eq!(checked, MAX_ERRORS);
    }
}
