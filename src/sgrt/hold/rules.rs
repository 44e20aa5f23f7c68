//! When to hold.

use phasmid_core::error::{Error, Result};

/// When to hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HoldRules {
    /// Deviations by which a quantity is taken for worse than its value.
    pub deviations: f64,
    /// Part of the tolerance, above 0 to 1, within which the beam may come on.
    pub enter: f64,
    /// For how long, in nanoseconds.
    pub settle_ns: u64,
    /// A reading older than this is none, in nanoseconds.
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
