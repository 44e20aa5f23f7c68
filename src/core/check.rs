//! Building blocks to check the values in a TOML document. A violation is reported with the line,
//! the value found and the allowed range.

use crate::error::Result;
use crate::source::TomlSource;
use std::fmt::{Display, LowerExp};
use std::ops::RangeInclusive;

/// Checks values read from a document and reports violations by file, line and field.
pub struct Check<'a> {
    /// The document the values come from.
    pub source: &'a TomlSource,
}

impl<'a> Check<'a> {
    /// Creates the checks for the values of a document.
    pub fn new(source: &'a TomlSource) -> Self {
        Self { source }
    }

    /// Checks that a value lies in an inclusive range. NaN is outside every range.
    ///
    /// # Errors
    /// Returns an error with the line of `field` if the value is out of range.
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
        Err(self.source.violation(field, found, allowed))
    }

    /// Checks that every value of a list lies in an inclusive range.
    ///
    /// # Errors
    /// Returns the error of [`Self::within`] for the first value out of range.
    pub fn all_within(
        &self,
        field: &str,
        values: &[f64],
        range: RangeInclusive<f64>,
    ) -> Result<()> {
        values
            .iter()
            .try_for_each(|&value| self.within(field, value, range.clone()))
    }

    /// Checks a condition.
    ///
    /// # Errors
    /// Returns an error with the line of `field`, the value found and what is allowed if `ok` is
    /// false.
    pub fn that(
        &self,
        ok: bool,
        field: &str,
        found: impl Display,
        allowed: impl Display,
    ) -> Result<()> {
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
