//! Beam hold: a state machine that decides from timed readings whether the beam may be on.
//!
//! A quantity is judged by its value and uncertainty: |value| + k standard deviations, relative to
//! its tolerance. The beam is held as soon as one quantity exceeds its tolerance, a warning arrives,
//! or readings stop. It comes on again once all quantities have been inside a narrower band without
//! interruption for the settling time. The narrower band and the settling time prevent a target at
//! the edge of its tolerance from switching the beam at every scan.
//!
//! `reading` holds the input, `reason` why the beam is held, `rules` the settings.

mod reading;
mod reason;
mod rules;
#[cfg(test)]
mod tests;

pub use reading::{Quantity, Reading};
pub use reason::Reason;
pub use rules::HoldRules;

use phasmid_core::error::Result;
use std::time::Duration;

/// The state of the beam.
#[derive(Debug, Clone, PartialEq)]
pub enum Beam {
    /// On.
    On,
    /// Off, for this reason.
    Held(Reason),
}

/// The state machine of the beam hold.
#[derive(Debug, Clone)]
pub struct Hold {
    rules: HoldRules,
    beam: Beam,
    /// Time of the last reading.
    last_ns: Option<u64>,
    /// Time since when all quantities have been within the narrower band.
    inside_since_ns: Option<u64>,
}

impl Hold {
    /// Creates a state machine that holds the beam until readings allow it.
    ///
    /// # Errors
    /// Returns an error if a rule is out of range.
    pub fn new(rules: HoldRules) -> Result<Self> {
        rules.check()?;
        Ok(Self {
            rules,
            beam: Beam::Held(Reason::NoReading),
            last_ns: None,
            inside_since_ns: None,
        })
    }

    /// Returns the current state of the beam.
    pub fn beam(&self) -> &Beam {
        &self.beam
    }

    /// Updates the state with a reading and its time.
    pub fn update(&mut self, time_ns: u64, reading: &Reading) -> &Beam {
        if self.last_ns.is_some_and(|last| time_ns < last) {
            return self.held(Reason::Clock);
        }
        self.at(time_ns);
        self.last_ns = Some(time_ns);
        let limit = if self.beam == Beam::On {
            1.0
        } else {
            self.rules.enter
        };
        if let Some(reason) = self.complaint(reading, limit) {
            return self.held(reason);
        }
        let since = *self.inside_since_ns.get_or_insert(time_ns);
        self.beam = if self.beam == Beam::On || time_ns - since >= self.rules.settle_ns {
            Beam::On
        } else {
            Beam::Held(Reason::Settling)
        };
        &self.beam
    }

    /// Checks the time only: holds the beam if the last reading is too old.
    pub fn at(&mut self, time_ns: u64) -> &Beam {
        let old = |last: u64| time_ns.saturating_sub(last) > self.rules.stale_ns;
        if self.last_ns.is_some_and(old) {
            return self.held(Reason::Stale);
        }
        &self.beam
    }

    /// Holds the beam because readings have stopped, for callers that detect this by another clock.
    pub fn silent(&mut self) -> &Beam {
        self.held(Reason::Stale)
    }

    /// Returns the maximum age of a reading.
    pub fn stale(&self) -> Duration {
        Duration::from_nanos(self.rules.stale_ns)
    }

    fn held(&mut self, reason: Reason) -> &Beam {
        self.inside_since_ns = None;
        self.beam = Beam::Held(reason);
        &self.beam
    }

    /// Finds what is wrong with a reading, if quantities may use at most the fraction `limit` of
    /// their tolerances.
    fn complaint(&self, reading: &Reading, limit: f64) -> Option<Reason> {
        if let Some(why) = reading.warnings.first() {
            return Some(Reason::Warning(why.clone()));
        }
        let share = |q: &Quantity| {
            (q.value.abs() + self.rules.deviations * q.deviation) / q.tolerance.max(0.0)
        };
        // NaN counts as outside.
        let outside = |q: &&Quantity| !(share(q) <= limit);
        let found = reading.quantities.iter().find(outside);
        if reading.quantities.is_empty() {
            return Some(Reason::Nothing);
        }
        found.map(|q| Reason::Outside {
            name: q.name,
            share: share(q),
        })
    }
}
