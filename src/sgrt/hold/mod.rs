//! When the beam may be on: a machine of three states that is told times and readings.
//!
//! A quantity counts with its uncertainty: |value| + k deviations over its tolerance. The beam is
//! held as soon as one exceeds its tolerance, a warning comes, or readings stay away; it comes on
//! again when all have been inside a narrower band for a while without a break. A narrower band and a
//! while, because a target at the edge would switch the beam with every scan otherwise.

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

/// What the beam is to do.
#[derive(Debug, Clone, PartialEq)]
pub enum Beam {
    /// On.
    On,
    /// Off, and why.
    Held(Reason),
}

/// The machine.
#[derive(Debug, Clone)]
pub struct Hold {
    rules: HoldRules,
    beam: Beam,
    /// Time of the last reading.
    last_ns: Option<u64>,
    /// Since when all is within the narrower band.
    inside_since_ns: Option<u64>,
}

impl Hold {
    /// Held until readings say otherwise.
    ///
    /// # Errors
    /// Rules out of range.
    pub fn new(rules: HoldRules) -> Result<Self> {
        rules.check()?;
        Ok(Self {
            rules,
            beam: Beam::Held(Reason::NoReading),
            last_ns: None,
            inside_since_ns: None,
        })
    }

    /// What the beam is to do, as far as is known.
    pub fn beam(&self) -> &Beam {
        &self.beam
    }

    /// Takes the reading of a moment.
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

    /// Looks at the clock alone: holds when the last reading has become too old.
    pub fn at(&mut self, time_ns: u64) -> &Beam {
        let old = |last: u64| time_ns.saturating_sub(last) > self.rules.stale_ns;
        if self.last_ns.is_some_and(old) {
            return self.held(Reason::Stale);
        }
        &self.beam
    }

    /// Holds because readings stay away, whatever the time: of who has a clock of another kind.
    pub fn silent(&mut self) -> &Beam {
        self.held(Reason::Stale)
    }

    /// How old a reading may become.
    pub fn stale(&self) -> Duration {
        Duration::from_nanos(self.rules.stale_ns)
    }

    fn held(&mut self, reason: Reason) -> &Beam {
        self.inside_since_ns = None;
        self.beam = Beam::Held(reason);
        &self.beam
    }

    /// What is wrong with a reading, where quantities may fill this part of their tolerances.
    fn complaint(&self, reading: &Reading, limit: f64) -> Option<Reason> {
        if let Some(words) = reading.warnings.first() {
            return Some(Reason::Warning(words.clone()));
        }
        let share = |q: &Quantity| {
            (q.value.abs() + self.rules.deviations * q.deviation) / q.tolerance.max(0.0)
        };
        // What is no number is outside.
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
