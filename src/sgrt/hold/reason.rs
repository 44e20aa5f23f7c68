//! Why the beam is held, and how that is put.

use std::fmt;

/// Why the beam is held.
#[derive(Debug, Clone, PartialEq)]
pub enum Reason {
    /// No reading has come yet.
    NoReading,
    /// The last reading is too old.
    Stale,
    /// Times run backwards.
    Clock,
    /// A reading of nothing.
    Nothing,
    /// A quantity exceeds its tolerance, or, when the beam is to come on, its part of it.
    Outside {
        /// What it is called.
        name: &'static str,
        /// Its size and deviations over its tolerance.
        share: f64,
    },
    /// A doubt about the reading.
    Warning(String),
    /// All is well, but not for long enough.
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
            Self::Warning(words) => write!(f, "{words}"),
            Self::Settling => write!(f, "settling"),
        }
    }
}
