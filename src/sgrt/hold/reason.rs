//! Reasons for holding the beam, and their messages.

use crate::ScanWarning;
use std::fmt;

/// Why the beam is held.
#[derive(Debug, Clone, PartialEq)]
pub enum Reason {
    /// No reading has come yet.
    NoReading,
    /// The last reading is too old.
    Stale,
    /// A reading is older than the one before it.
    Clock,
    /// A reading contains no quantity.
    Nothing,
    /// A quantity exceeds its tolerance or, before the beam comes on, the narrower band.
    Outside {
        /// Name of the quantity.
        name: &'static str,
        /// Absolute value plus k standard deviations, divided by the tolerance.
        share: f64,
    },
    /// The reading has a warning.
    Warning(ScanWarning),
    /// All quantities are inside the narrower band, but not for long enough yet.
    Settling,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoReading => write!(f, "no reading yet"),
            Self::Stale => write!(f, "the last reading is too old"),
            Self::Clock => write!(f, "a reading is older than the one before"),
            Self::Nothing => write!(f, "a reading without a quantity"),
            Self::Outside { name, share } => {
                write!(f, "{name} at {:.0} % of its tolerance", 100.0 * share)
            }
            Self::Warning(why) => write!(f, "{why}"),
            Self::Settling => write!(f, "settling"),
        }
    }
}
