//! When the beam may be on: a machine of three states that is told times and readings.
//!
//! A quantity counts with its uncertainty: |value| + k deviations over its tolerance. The beam is
//! held as soon as one exceeds its tolerance, a warning comes, or readings stay away; it comes on
//! again when all have been inside a narrower band for a while without a break. A narrower band and a
//! while, because a target at the edge would switch the beam with every scan otherwise.

use crate::error::{Error, Result};
use std::fmt;

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

/// Something that has to stay within a tolerance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// What it is called.
    pub name: &'static str,
    /// Its value, whose size counts.
    pub value: f64,
    /// Standard deviation of the value.
    pub deviation: f64,
    /// How large it may be, positive; the unit is that of the value.
    pub tolerance: f64,
}

/// What one scan says.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Reading {
    /// What has to stay within tolerance.
    pub quantities: Vec<Quantity>,
    /// Reasons to doubt it, as a person reads them.
    pub warnings: Vec<String>,
}

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

#[cfg(test)]
mod tests {
    use super::*;
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
    fn comes_on_after_a_while_inside() {
        let mut hold = on_after((0..=400).step_by(100));
        assert_eq!(hold.beam(), &Beam::Held(Reason::Settling));
        assert_eq!(hold.update(500 * MS, &reading(0.5)), &Beam::On);
        // Between the bands it stays on: 2.3 + 0.5 of 3.
        assert_eq!(hold.update(600 * MS, &reading(-2.3)), &Beam::On);
        // The uncertainty takes it out: 2.6 + 0.5 of 3.
        let out = hold.update(700 * MS, &reading(2.6)).clone();
        assert!(matches!(
            out,
            Beam::Held(Reason::Outside { name: "tumour", .. })
        ));
        // There it stays until it is well inside, and for long enough.
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
    fn warnings_gaps_and_clocks_hold() {
        let on = || on_after((0..=500).step_by(100));
        let mut warned = reading(0.0);
        warned.warnings.push("not determined".to_owned());
        let beam = on().update(600 * MS, &warned).clone();
        assert_eq!(
            beam,
            Beam::Held(Reason::Warning("not determined".to_owned()))
        );
        let mut hold = on();
        assert_eq!(hold.at(900 * MS), &Beam::On);
        assert_eq!(hold.at(901 * MS), &Beam::Held(Reason::Stale));
        // A reading after a gap has to settle anew.
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
    fn rules_out_of_range_are_named() {
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
        /// Whatever comes: on only if the last reading is inside, without a warning, and everything
        /// since `settle` ago was.
        #[test]
        fn on_is_never_unfounded(steps in proptest::collection::vec((0_u64..300, 0.0_f64..4.0, 0..20_u8), 1..60)) {
            let rules = HoldRules::default();
            let mut hold = Hold::new(rules).unwrap();
            let (mut time, mut history) = (0, Vec::new());
            for (wait, value, odd) in steps {
                time += wait * MS;
                let mut r = reading(value);
                if odd == 0 {
                    r.warnings.push("doubt".to_owned());
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
