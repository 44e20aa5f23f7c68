use crate::led::{Model, State};

/// Constants in nanoseconds.
fn model(rise_ns: f64, droop: &[(f64, f64)]) -> Model {
    Model::of(rise_ns, droop.to_vec())
}

fn state(emission: f64, heat: f64) -> State {
    State {
        emission,
        heat: [heat; 8],
    }
}

fn error(found: f64, exact: f64) -> f64 {
    match exact {
        0.0 => found.abs(),
        _ => (found / exact - 1.0).abs(),
    }
}

/// See `table.py`, which wrote it: steps of 1e-9 to 1e12 time constants, ratios of the constants of
/// 1 to 1e9.
#[test]
fn agrees_with_100_digits() {
    let (mut lines, mut worst) = (0, [0.0f64; 3]);
    for line in include_str!("table.csv").lines() {
        let v: Vec<f64> = line.split(',').map(|v| v.parse().unwrap()).collect();
        let [rise, warm, share, x, heat, drive, step, exact @ ..] = v.as_slice() else {
            panic!("{line}");
        };
        let model = model(*rise, &[(*warm, *share)]);
        let from = state(*x, *heat);
        let after = model.after(&from, *drive, *step);
        let found = [
            model.mean(&from, *drive, *step),
            after.emission,
            after.heat[0],
        ];
        for ((found, exact), worst) in found.into_iter().zip(exact).zip(&mut worst) {
            *worst = worst.max(error(found, *exact));
        }
        lines += 1;
    }
    println!("{lines} lines, worst {worst:?}");
    assert_eq!(lines, 203);
    assert!(worst.iter().all(|worst| *worst < 1e-14), "{worst:?}");
}

/// All ranges of steps and ratios that a profile may have, and beyond.
fn grid() -> impl Iterator<Item = (Model, State, f64, f64)> {
    let rises = [1.0, 1e3, 1e9];
    let ratios = [1.0, 1.0 + 1e-9, 30.0, 1e9, 1e15];
    let starts = [
        (0.0, 0.0, 1.0),
        (1.0, 1.0, 0.0),
        (0.3, 0.8, 0.55),
        (1.0, 0.0, 1.0),
    ];
    let models = rises.into_iter().flat_map(move |rise| {
        ratios.map(|ratio| model(rise, &[(rise * ratio, 0.5), (7e9, 0.25), (1e3, 0.15)]))
    });
    models.flat_map(move |model| {
        // Of few bits, so that quarters of them are exact.
        let step = |k: u8| f64::from(10f32.powf(0.75 * f32::from(k) - 4.3));
        let steps = (0..32).map(step);
        let cases: Vec<_> = steps
            .flat_map(|step| starts.map(|(x, heat, drive)| (state(x, heat), drive, step)))
            .collect();
        cases
            .into_iter()
            .map(move |(s, u, h)| (model.clone(), s, u, h))
    })
}

#[test]
fn two_steps_are_one_and_light_is_never_negative() {
    for (model, from, drive, step) in grid() {
        let [whole, near] = [step, 0.25 * step].map(|step| model.mean(&from, drive, step));
        let middle = model.after(&from, drive, 0.25 * step);
        let far = model.mean(&middle, drive, 0.75 * step);
        let both = 0.25 * near + 0.75 * far;
        let case = format!("{model:?} {from:?} {drive} {step}");
        assert!(error(both, whole) < 1e-14, "{both} {whole}: {case}");
        assert!(
            (0.0..=1.0).contains(&whole) && near >= 0.0 && far >= 0.0,
            "{case}"
        );
        let [one, two] = [
            model.after(&from, drive, step),
            model.after(&middle, drive, 0.75 * step),
        ];
        assert!(error(two.emission, one.emission) < 1e-14, "{case}");
        for (two, one) in two.heat.into_iter().zip(one.heat) {
            assert!(
                error(two, one) < 1e-14 && (0.0..=1.0).contains(&one),
                "{case}"
            );
        }
        // More current is more light of the same parts at the same heat.
        assert!(model.mean(&from, 0.0, step) <= model.mean(&state(1.0, from.heat[0]), 0.0, step));
    }
}

#[test]
fn limits_are_what_they_are_in_closed_form() {
    // Without droop: a single constant.
    let plain = model(2000.0, &[]);
    for step in [1e-3, 1.0, 700.0, 5e3, 1e7] {
        let a: f64 = step / 2000.0;
        let rise = plain.mean(&state(0.0, 0.0), 1.0, step);
        if a > 0.1 {
            assert!(error(rise, 1.0 + (-a).exp_m1() / a) < 1e-14, "{step}");
        } else {
            assert!(
                error(rise, a / 2.0 - a * a / 6.0 + a.powi(3) / 24.0) < 1e-5,
                "{step}"
            );
        }
        let fall = plain.mean(&state(1.0, 0.0), 0.0, step);
        assert!(error(rise + fall, 1.0) < 1e-15, "{step}");
    }
    // No step is the light as it is; a settled source stays.
    let warm = model(1000.0, &[(1e9, 0.2), (6e10, 0.1)]);
    for drive in [0.0, 0.4, 1.0] {
        let settled = warm.settled(drive);
        let light = drive * (1.0 - 0.3 * drive);
        for step in [0.0, 1e-9, 1.0, 1e6, 1e18] {
            assert!(error(warm.mean(&settled, drive, step), light) < 1e-14);
            let after = warm.light(&warm.after(&settled, drive, step));
            assert!(error(after, light) < 1e-14);
        }
    }
    // A rise without length: droop alone, from cold.
    let droop = model(1e-9, &[(1e9, 0.2)]);
    let t: f64 = 0.7;
    let exact = 0.8 - 0.2 * (-t).exp_m1() / t;
    assert!(error(droop.mean(&state(1.0, 0.0), 1.0, t * 1e9), exact) < 1e-14);
}

/// Ten minutes of pulses: the heat is a geometric series.
#[test]
fn trains_of_pulses_warm_by_a_geometric_series() {
    let (warm_ns, share) = (9e10, 0.12);
    let model = model(1500.0, &[(warm_ns, share)]);
    let (on, off, count) = (3e6, 17e6, 30_000);
    let mut now = state(0.0, 0.0);
    for _ in 0..count {
        now = model.after(&now, 1.0, on);
        now = model.after(&now, 0.0, off);
    }
    let left = |ns: f64| (-ns / warm_ns).exp();
    let gone = |ns: f64| -(-ns / warm_ns).exp_m1();
    let period = on + off;
    let total = period * f64::from(count);
    let exact = gone(on) * left(off) * gone(total) / gone(period);
    assert!(error(now.heat[0], exact) < 1e-11, "{} {exact}", now.heat[0]);
    // The mean of a pulse is the duty's, but for the ripple.
    assert!((now.heat[0] - 0.15 * gone(total)).abs() < 1e-4);
    let cold = model.mean(&state(0.0, 0.0), 1.0, on);
    let warm = model.mean(&now, 1.0, on);
    assert!((warm / cold - (1.0 - share * exact)).abs() < 1e-5);
}
