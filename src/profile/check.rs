//! What the named checks of profiles' and scenes' values are made of: what cannot exist is refused with its line and its range.

use super::source::TomlSource;
use crate::error::Result;
use crate::geometry::Lens;
use std::fmt::{Display, LowerExp};
use std::ops::RangeInclusive;

/// A source with the checks that its values go through.
pub(crate) struct Check<'a> {
    pub(crate) source: &'a TomlSource,
}

impl<'a> Check<'a> {
    pub(crate) fn new(source: &'a TomlSource) -> Self {
        Self { source }
    }

    /// A finite number in an inclusive range.
    pub(crate) fn within<T>(&self, field: &str, value: T, range: RangeInclusive<T>) -> Result<()>
    where
        T: PartialOrd + Display + LowerExp + Copy,
    {
        // NaN compares as outside of every range.
        if range.contains(&value) {
            return Ok(());
        }
        let (low, high) = (range.start(), range.end());
        let allowed = if low == high {
            low.to_string()
        } else {
            format!("{low} to {high}")
        };
        // Three hundred digits tell no more than an exponent.
        let plain = value.to_string();
        let found = if plain.len() <= 24 {
            plain
        } else {
            format!("{value:e}")
        };
        Err(self.source.violation(field, found, allowed))
    }

    pub(crate) fn all_within(
        &self,
        field: &str,
        values: &[f64],
        range: RangeInclusive<f64>,
    ) -> Result<()> {
        values
            .iter()
            .try_for_each(|&value| self.within(field, value, range.clone()))
    }

    pub(crate) fn that(
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

pub(crate) fn name(text: &str, field: &str, check: &Check<'_>) -> Result<()> {
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

/// Refuses coefficients for which the image folds over: some pixel would have no ray, or two.
pub(crate) fn distortion(lens: &Lens, field: &str, check: &Check<'_>) -> Result<()> {
    check.all_within(field, &lens.distortion, -1e3..=1e3)?;
    lens.folds_before().map_or(Ok(()), |px| {
        Err(check
            .source
            .violation(field, Lens::fold_found(px), Lens::FOLD_ALLOWED))
    })
}
