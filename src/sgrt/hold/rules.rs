//! Settings of the beam hold.

use phasmid_core::error::{Error, Result};

/// Settings of [`Hold`](super::Hold).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HoldRules {
    /// Number of standard deviations added to the absolute value of a quantity.
    pub deviations: f64,
    /// Narrower band within which the beam may come on, as a fraction of the tolerance; above 0, at
    /// most 1.
    pub enter: f64,
    /// Time that all quantities must stay within the narrower band before the beam comes on, in
    /// nanoseconds.
    pub settle_ns: u64,
    /// Maximum age of a reading in nanoseconds.
    pub stale_ns: u64,
}

impl Default for HoldRules {
    fn default() -> Self {
        Self {
            deviations: 2.0,
            enter: 0.8,
            settle_ns: 500_000_000,
            stale_ns: 400_000_000,
        }
    }
}

impl HoldRules {
    pub(super) fn check(&self) -> Result<()> {
        if !(self.deviations.is_finite() && self.deviations >= 0.0) {
            return Err(Error::input("deviations", self.deviations, "0 or more"));
        }
        if !(self.enter > 0.0 && self.enter <= 1.0) {
            return Err(Error::input("enter", self.enter, "above 0 to 1"));
        }
        if self.stale_ns == 0 {
            return Err(Error::input("stale_ns", 0, "1 or more"));
        }
        Ok(())
    }
}
