//! Projector response: light as a function of displayed level.

use phasmid_core::check::Check;
use phasmid_core::error::Result;
use serde::{Deserialize, Serialize};

/// Light over level, both from 0 (black) to 1 (full white).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Response {
    /// Light is the level raised to this power (Zhang and Yau: "Generic nonsinusoidal phase error
    /// correction for three-dimensional shape measurement using a digital video projector", Applied
    /// Optics 46, 2007); 1 is linear.
    Gamma(f64),
    /// Light measured at equally spaced levels from black to full white, interpolated linearly: 0
    /// to 1, the last value 1.
    Table(Vec<f64>),
}

impl Response {
    /// Returns whether the response is linear.
    #[inline]
    pub fn is_straight(&self) -> bool {
        match self {
            Self::Gamma(gamma) => *gamma == 1.0,
            Self::Table(table) => {
                let last = (table.len() - 1) as f64;
                let step = |(i, &light): (usize, &f64)| light == i as f64 / last;
                table.iter().enumerate().all(step)
            }
        }
    }

    /// Returns the light, 0 to 1, of a level from 0 to 1.
    #[inline]
    pub fn light(&self, level: f64) -> f64 {
        match self {
            Self::Gamma(gamma) => level.powf(*gamma),
            Self::Table(table) => {
                let at = level * (table.len() - 1) as f64;
                let i = (at as usize).min(table.len() - 2);
                table[i] + (at - i as f64) * (table[i + 1] - table[i])
            }
        }
    }
}

pub(super) fn check(response: &Response, field: &str, check: &Check<'_>) -> Result<()> {
    match response {
        Response::Gamma(gamma) => check.within(&format!("{field}.gamma"), *gamma, 0.1..=10.0),
        Response::Table(table) => {
            let field = format!("{field}.table");
            check.that(
                (2..=4096).contains(&table.len()),
                &field,
                format!("{} values", table.len()),
                "2 to 4096 values",
            )?;
            check.all_within(&field, table, 0.0..=1.0)?;
            let last = table[table.len() - 1];
            check.that(
                last == 1.0,
                &field,
                format!("{last} at full white"),
                "1 as the last value: light relative to full white",
            )
        }
    }
}
