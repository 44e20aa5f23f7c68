//! Checks: what a study holds its figures to.

/// A figure and what it has to be.
#[derive(Debug, Clone, PartialEq)]
pub struct Check {
    /// What is checked, with the unit.
    pub what: String,
    /// The figure.
    pub found: f64,
    /// The largest that passes.
    pub allowed: f64,
}

impl Check {
    /// A figure that may be at most so large.
    pub fn at_most(what: impl Into<String>, found: f64, allowed: f64) -> Self {
        Self {
            what: what.into(),
            found,
            allowed,
        }
    }

    /// Whether it is met; a figure that is none is not.
    pub fn passed(&self) -> bool {
        self.found <= self.allowed
    }
}
