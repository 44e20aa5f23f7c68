//! Checks: limits on the results of a study.

/// A result and its limit.
#[derive(Debug, Clone, PartialEq)]
pub struct Check {
    /// Checked quantity, with its unit.
    pub what: String,
    /// The result.
    pub found: f64,
    /// The largest value that passes.
    pub allowed: f64,
}

impl Check {
    /// Makes a check that a result is at most `allowed`.
    pub fn at_most(what: impl Into<String>, found: f64, allowed: f64) -> Self {
        Self {
            what: what.into(),
            found,
            allowed,
        }
    }

    /// Whether the check passes. NaN does not pass.
    pub fn passed(&self) -> bool {
        self.found <= self.allowed
    }
}
