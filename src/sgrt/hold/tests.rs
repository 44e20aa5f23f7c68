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
    // Between the two bands the beam stays on: 2.3 + 0.5 of 3.
    assert_eq!(hold.update(600 * MS, &reading(-2.3)), &Beam::On);
    // The uncertainty exceeds the tolerance: 2.6 + 0.5 of 3.
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
    /// Whatever the readings, the beam is on only if every reading of the last `settle_ns` was within
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
