//! Beam hold: a state machine that decides from timed readings whether the beam may be on.
//!
//! A quantity is judged by its value and uncertainty: |value| + k standard deviations, relative to
//! its tolerance. The beam is held as soon as one quantity exceeds its tolerance, a warning arrives,
//! or readings stop. It comes on again once all quantities have been inside a narrower band without
//! interruption for the settling time. The narrower band and the settling time prevent a target at
//! the edge of its tolerance from switching the beam at every scan.

use crate::ScanWarning;
use phasmid_core::error::{Error, Result};
use std::fmt;
use std::time::Duration;

/// A quantity that has to stay within a tolerance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// Name, as shown to users.
    pub name: &'static str,
    /// Value; its absolute value is compared with the tolerance.
    pub value: f64,
    /// Standard deviation of the value.
    pub deviation: f64,
    /// Positive tolerance, in the unit of the value.
    pub tolerance: f64,
}

/// The reading of one scan.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Reading {
    /// Quantities that have to stay within tolerance.
    pub quantities: Vec<Quantity>,
    /// Reasons to doubt the reading.
    pub warnings: Vec<ScanWarning>,
}

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

/// Settings of [`Hold`].
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
    fn check(&self) -> Result<()> {
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

#[cfg(test)]
mod tests {
    //! Tests the bands, gaps and clocks. Tests that the beam is on only after sufficient readings.

    use super::*;
    use crate::Lost;
    use proptest::prelude::*;

    const MS: u64 = 1_000_000;

    fn reading(value: f64) -> Reading {
        Reading {
            quantities: vec![Quantity {
                name: "tumour",
                value,
                deviation: 0.25,
                tolerance: 3.0,
            }],
            warnings: Vec::new(),
        }
    }

    fn on_after(times: impl Iterator<Item = u64>) -> Hold {
        let mut hold = Hold::new(HoldRules::default()).unwrap();
        times.for_each(|t| {
            hold.update(t * MS, &reading(0.5));
        });
        hold
    }

    #[test]
    fn beam_comes_on_after_settling_within_tolerance() {
        let mut hold = on_after((0..=400).step_by(100));
        assert_eq!(hold.beam(), &Beam::Held(Reason::Settling));
        assert_eq!(hold.update(500 * MS, &reading(0.5)), &Beam::On);
        // Between the narrower band and the tolerance of 3 the beam stays on: 2.3 + 0.5 = 2.8.
        assert_eq!(hold.update(600 * MS, &reading(-2.3)), &Beam::On);
        // With its uncertainty, the value exceeds the tolerance of 3: 2.6 + 0.5 = 3.1.
        let out = hold.update(700 * MS, &reading(2.6)).clone();
        assert!(matches!(
            out,
            Beam::Held(Reason::Outside { name: "tumour", .. })
        ));
        // The beam stays held until the quantity has been inside the narrower band for long enough.
        assert_ne!(hold.update(800 * MS, &reading(2.3)), &Beam::On);
        for t in (900..1400).step_by(100) {
            assert_eq!(
                hold.update(t * MS, &reading(1.0)),
                &Beam::Held(Reason::Settling)
            );
        }
        assert_eq!(hold.update(1400 * MS, &reading(1.0)), &Beam::On);
    }

    #[test]
    fn warnings_gaps_and_wrong_clocks_hold_the_beam() {
        let on = || on_after((0..=500).step_by(100));
        let mut warned = reading(0.0);
        warned.warnings.push(Lost::Line.into());
        let beam = on().update(600 * MS, &warned).clone();
        assert_eq!(beam, Beam::Held(Reason::Warning(Lost::Line.into())));
        let mut hold = on();
        assert_eq!(hold.at(900 * MS), &Beam::On);
        assert_eq!(hold.at(901 * MS), &Beam::Held(Reason::Stale));
        // After a gap the readings have to settle again.
        assert_eq!(
            hold.update(950 * MS, &reading(0.0)),
            &Beam::Held(Reason::Settling)
        );
        let mut hold = on();
        assert_eq!(
            hold.update(1000 * MS, &reading(0.0)),
            &Beam::Held(Reason::Settling)
        );
        assert_eq!(
            on().update(499 * MS, &reading(0.0)),
            &Beam::Held(Reason::Clock)
        );
        assert_eq!(
            on().update(600 * MS, &Reading::default()),
            &Beam::Held(Reason::Nothing)
        );
        for bad in [f64::NAN, f64::INFINITY] {
            assert_ne!(on().update(600 * MS, &reading(bad)), &Beam::On);
        }
        let mut none = reading(0.0);
        none.quantities[0].tolerance = 0.0;
        assert_ne!(on().update(600 * MS, &none), &Beam::On);
    }

    #[test]
    fn refuses_rules_out_of_range_by_name() {
        for (rules, word) in [
            (
                HoldRules {
                    enter: 0.0,
                    ..HoldRules::default()
                },
                "enter",
            ),
            (
                HoldRules {
                    deviations: f64::NAN,
                    ..HoldRules::default()
                },
                "deviations",
            ),
            (
                HoldRules {
                    stale_ns: 0,
                    ..HoldRules::default()
                },
                "stale_ns",
            ),
        ] {
            let words = Hold::new(rules).unwrap_err().to_string();
            assert!(words.starts_with(word), "{words}");
        }
    }

    proptest! {
        /// For any readings, the beam is on only if every reading of the last `settle_ns` was within
        /// tolerance and without a warning.
        #[test]
        fn beam_is_on_only_after_settled_readings(steps in proptest::collection::vec((0_u64..300, 0.0_f64..4.0, 0..20_u8), 1..60)) {
            let rules = HoldRules::default();
            let mut hold = Hold::new(rules).unwrap();
            let (mut time, mut history) = (0, Vec::new());
            for (wait, value, odd) in steps {
                time += wait * MS;
                let mut r = reading(value);
                if odd == 0 {
                    r.warnings.push(Lost::Line.into());
                }
                hold.update(time, &r);
                history.push((time, value, odd == 0));
                if hold.beam() == &Beam::On {
                    let sound = |&(_, v, odd): &(u64, f64, bool)| !odd && v + 0.5 <= 3.0;
                    let start = history.iter().rposition(|h| !sound(h)).map_or(0, |i| i + 1);
                    prop_assert!(time - history[start].0 >= rules.settle_ns);
                }
            }
        }
    }
}
