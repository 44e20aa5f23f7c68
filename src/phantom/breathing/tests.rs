//! Cycles against closed forms, bounds and standard deviations.

use super::*;

fn patient(edit: impl FnOnce(&mut Patient)) -> Patient {
    let mut p = Patient::load("p01-woman-mean").unwrap();
    p.treatment = Treatment::default();
    edit(&mut p);
    p
}

#[test]
fn a_treatment_without_differences_is_the_mean_cycle() {
    let p = patient(|p| {
        (p.breathing.period_sd, p.breathing.amplitude_sd) = (0.0, 0.0);
        p.breathing.decoupling_sd = 0.0;
    });
    let course = Course::new(&p);
    for i in 0..500 {
        let t = -7.0 + f64::from(i) * 0.113;
        let [a, b] = [Day::Planning, Day::Treatment].map(|day| course.weights(day, t));
        assert_eq!(a, b);
    }
    for k in 0..10 {
        let phase = f64::from(k) / 10.0;
        let at = course.weights(Day::Planning, (3.0 + phase) * p.breathing.period_s);
        for (a, b) in at.iter().zip(course.mean(phase)) {
            assert!((a - b).abs() < 1e-12);
        }
    }
    assert_eq!(course.mean(0.5).map(f64::abs), [0.0; MODES].map(f64::abs));
}

/// Compares the area of the loop of two courses, one of which lags, with its value from the Fourier
/// series of cos^2n: the coefficient c_k is 2 C(2n, n - k) / 4^n and contributes an area of pi k c_k^2
/// sin(2 pi k lag).
#[test]
fn hysteresis_goes_around_the_area_of_its_closed_form() {
    for n in [1u32, 2, 3, 6] {
        for lag in [0.05, -0.12] {
            let p = patient(|p| {
                p.breathing.exponent = n;
                (p.breathing.abdomen_mm, p.breathing.diaphragm_mm) = (10.0, 15.0);
                p.breathing.diaphragm_lag = lag;
            });
            let course = Course::new(&p);
            const STEPS: usize = 4000;
            let at = |i: usize| {
                let w = course.mean(i as f64 / STEPS as f64);
                [w[ABDOMEN], w[DIAPHRAGM]]
            };
            let area: f64 = (0..STEPS)
                .map(|i| {
                    let ([x, y], [u, v]) = (at(i), at(i + 1));
                    0.5 * (x * v - y * u)
                })
                .sum();
            let choose = |k: u32| {
                (1..=k)
                    .map(|i| f64::from(2 * n - k + i) / f64::from(i))
                    .product::<f64>()
            };
            let closed: f64 = (1..=n)
                .map(|k| {
                    let c = 2.0 * choose(n - k) / 4f64.powi(n as i32);
                    PI * f64::from(k) * c * c * (2.0 * PI * f64::from(k) * lag).sin()
                })
                .sum();
            let closed = 150.0 * closed;
            assert!(
                (area - closed).abs() < 1e-4 * closed.abs() + 1e-9,
                "{n} {lag}: {area} {closed}"
            );
            assert!(closed.abs() > 5.0);
        }
    }
}

#[test]
fn weights_stay_in_their_bounds_and_have_no_kink() {
    let p = patient(|p| {
        let b = &mut p.breathing;
        (b.period_sd, b.amplitude_sd, b.decoupling_sd) = (0.2, 0.3, 0.1);
        (b.thorax_lag, b.lung_lag) = (-0.1, 0.2);
        p.treatment.amplitude = 1.4;
        (p.treatment.drift_mm, p.treatment.diaphragm_drift_mm) = (-6.0, 5.0);
        (p.treatment.wander_mm, p.treatment.drift_time_s) = (1.0, 60.0);
        (p.treatment.coughs_per_min, p.treatment.coughs_at_s) = (4.0, vec![10.0, 10.3]);
        p.treatment.posture_mm = 2.0;
    });
    let (course, bounds) = (Course::new(&p), Course::bounds(&p));
    let mut seen = [[f64::MAX, f64::MIN]; MODES];
    let mut before = course.cycles(Day::Treatment, -20.001);
    for i in 0..60_000 {
        let t = -20.0 + f64::from(i) * 0.01;
        let w = course.weights(Day::Treatment, t);
        for k in 0..MODES {
            assert!(
                bounds[k][0] <= w[k] && w[k] <= bounds[k][1],
                "{k} at {t}: {}",
                w[k]
            );
            seen[k] = [seen[k][0].min(w[k]), seen[k][1].max(w[k])];
        }
        let cycles = course.cycles(Day::Treatment, t);
        assert!(cycles > before, "time goes on at {t}");
        before = cycles;
    }
    // The bounds are reasonably tight.
    for k in 0..MODES {
        let [range, used] = [bounds[k], seen[k]].map(|[a, b]| b - a);
        assert!(used > 0.4 * range, "{k}: {used} of {range}");
    }
    // Left and right slopes agree at the borders of coughs, slots and knots.
    let step = 1e-5;
    for t in [10.0, 10.25, 10.3, 10.5, 10.45, 20.0, 0.0, 15.0, 30.0] {
        let [a, b, c] = [-1.0, 0.0, 1.0].map(|s| course.weights(Day::Treatment, t + s * step));
        for k in 0..MODES {
            let kink = (c[k] - 2.0 * b[k] + a[k]) / step;
            assert!(kink.abs() < 0.1, "{k} at {t}: {kink}");
        }
    }
}

#[test]
fn cycles_vary_by_the_deviations_that_are_asked_for() {
    let p = patient(|p| (p.breathing.period_sd, p.breathing.amplitude_sd) = (0.1, 0.2));
    let course = Course::new(&p);
    let period = p.breathing.period_s;
    // Times of end-inhale, by bisection of a monotonic function.
    let when = |cycle: i32| {
        let (mut lo, mut hi) = (
            period * (f64::from(cycle) - 1.0),
            period * (f64::from(cycle) + 1.0),
        );
        for _ in 0..60 {
            let mid = 0.5 * (lo + hi);
            match course.cycles(Day::Treatment, mid) < f64::from(cycle) {
                true => lo = mid,
                false => hi = mid,
            }
        }
        lo
    };
    let ends: Vec<f64> = (0..2000).map(when).collect();
    let deviation = |v: &[f64]| {
        let mean = v.iter().sum::<f64>() / v.len() as f64;
        let squares: f64 = v.iter().map(|v| (v - mean).powi(2)).sum();
        (mean, (squares / v.len() as f64).sqrt())
    };
    let lengths: Vec<f64> = ends.windows(2).map(|p| p[1] - p[0]).collect();
    let (mean, sd) = deviation(&lengths);
    assert!((mean / period - 1.0).abs() < 0.002, "{mean}");
    assert!((sd / period - 0.1).abs() < 0.01, "{sd}");
    let rest = course.mean(0.0)[ABDOMEN];
    let depths: Vec<f64> = (ends.iter())
        .map(|&t| course.weights(Day::Treatment, t)[ABDOMEN] / rest)
        .collect();
    let (mean, sd) = deviation(&depths);
    assert!(
        (mean - 1.0).abs() < 0.03 && (sd - 0.2).abs() < 0.03,
        "{mean} {sd}"
    );
}
