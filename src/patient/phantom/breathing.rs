//! Weights of the modes over time: any moment by itself, the same for the same seed.
//!
//! A cycle follows cos^2n(pi phase) (Lujan et al., Medical Physics 26, 1999), 1 at the end of
//! inhaling (phase 0, as a 4D-CT counts) and 0 at the end of exhaling (phase 0.5), where breath
//! rests the longer the larger n is. Each mode follows it by a lag of its own, so that a tumour goes on
//! a loop, and on another beside the skin: Seppenwoolde et al., Int. J. Radiation Oncology 53, 2002,
//! saw 1 to 5 mm between a tumour's ways in and out in half of 21 patients, and 12 mm of motion along
//! the body in lower lobes. Ranges of diaphragms and periods: Keall et al., AAPM report 91 (task group
//! 76), Medical Physics 33, 2006.

use super::modes::{ABDOMEN, DIAPHRAGM, LUNG, MODES, POSTURE, THORAX};
use super::parameters::{Breathing, Patient, Treatment};
use super::random::Draws;
use super::spline::{most_of, most_of_differences, wander};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// The end of exhaling, where everything rests at planning: phase 50 of a 4D-CT.
pub const REFERENCE_PHASE: usize = 5;
/// Phases of a 4D-CT.
pub const PHASES: usize = 10;

/// Streams of numbers: course of the phase, depth of cycles, depth of each mode, baseline, coughs.
const PHASE: u32 = 10;
const DEPTH: u32 = 11;
const OWN: u32 = 12;
const BASELINE: u32 = 20;
const COUGH: u32 = 21;
/// Time over which a baseline wanders.
const WANDER_S: f64 = 15.0;
/// In each of these there is at most one cough by chance.
const SLOT_S: f64 = 10.0;
/// A cough's bursts: when each begins and how strong it is. Bursts last half a second.
const BURSTS: [(f64, f64); 3] = [(0.0, 1.0), (0.45, 0.8), (0.9, 0.55)];
const BURST_S: f64 = 0.5;
const COUGH_S: f64 = 1.4;
/// How much of the drift of the abdomen the thorax has, and how far the diaphragm is thrown up by a
/// cough over the abdomen's way in.
const THORAX_DRIFT: f64 = 0.4;
const THROWN_UP: f64 = 0.5;

/// A day.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Day {
    /// The mean cycle, again and again: what a 4D-CT bins.
    Planning,
    /// Cycles that vary, drift, coughs, posture and set-up.
    Treatment,
}

/// The course of one patient's breathing.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Course {
    breathing: Breathing,
    treatment: Treatment,
    seed: u64,
}

impl Course {
    pub(super) fn new(p: &Patient) -> Self {
        Self {
            breathing: p.breathing,
            treatment: p.treatment.clone(),
            seed: p.seed,
        }
    }

    /// How many cycles have passed at a time in seconds; phase 0 is the end of an inhaling.
    pub(super) fn cycles(&self, day: Day, time_s: f64) -> f64 {
        match day {
            Day::Planning => time_s / self.breathing.period_s,
            Day::Treatment => {
                let even = time_s / (self.breathing.period_s * self.treatment.period);
                let most = most_of_differences(self.breathing.period_sd);
                even + wander(Draws::new(self.seed, PHASE), even, most).0
            }
        }
    }

    /// Weights of the mean cycle at a phase, in millimetres; 0 at phase 0.5.
    pub(super) fn mean(&self, phase: f64) -> [f64; MODES] {
        std::array::from_fn(|mode| {
            let (amplitude_mm, lag) = self.mode(mode);
            let rest = course(0.5 - lag, self.breathing.exponent);
            amplitude_mm * (course(phase - lag, self.breathing.exponent) - rest)
        })
    }

    /// Weights on a day at a time, in millimetres.
    pub(super) fn weights(&self, day: Day, time_s: f64) -> [f64; MODES] {
        let cycles = self.cycles(day, time_s);
        let mut weights = self.mean(cycles);
        if day == Day::Planning {
            return weights;
        }
        let (b, t) = (&self.breathing, &self.treatment);
        let varied = |stream, deviation| {
            1.0 + wander(Draws::new(self.seed, stream), cycles, most_of(deviation)).0
        };
        let depth = t.amplitude * varied(DEPTH, b.amplitude_sd);
        for (mode, weight) in weights.iter_mut().enumerate() {
            *weight *= depth * varied(OWN + mode as u32, b.decoupling_sd);
        }
        let along = time_s / t.drift_time_s;
        let drift = along / along.hypot(1.0);
        let most = most_of(t.wander_mm);
        let baseline = wander(Draws::new(self.seed, BASELINE), time_s / WANDER_S, most).0;
        let cough = t.cough_mm * self.cough(time_s);
        weights[ABDOMEN] += t.drift_mm * drift + baseline;
        weights[THORAX] += THORAX_DRIFT * (t.drift_mm * drift + baseline);
        weights[POSTURE] += t.posture_mm + cough;
        weights[DIAPHRAGM] += t.diaphragm_drift_mm * drift + baseline - THROWN_UP * cough;
        weights
    }

    /// Ranges that hold the weights at every moment of both days, in millimetres.
    pub(super) fn bounds(p: &Patient) -> [[f64; 2]; MODES] {
        let (course, b, t) = (Self::new(p), &p.breathing, &p.treatment);
        let deepest =
            t.amplitude * (1.0 + most_of(b.amplitude_sd)) * (1.0 + most_of(b.decoupling_sd));
        let deepest = deepest.max(1.0);
        let baseline = most_of(t.wander_mm);
        std::array::from_fn(|mode| {
            let (amplitude_mm, lag) = course.mode(mode);
            let rest = self::course(0.5 - lag, b.exponent);
            let around = match mode {
                THORAX => [THORAX_DRIFT * (t.drift_mm.abs() + baseline); 2],
                ABDOMEN => [t.drift_mm.abs() + baseline; 2],
                POSTURE => [(-t.posture_mm).max(0.0), t.posture_mm.max(0.0) + t.cough_mm],
                DIAPHRAGM => {
                    let both = t.diaphragm_drift_mm.abs() + baseline;
                    [both + THROWN_UP * t.cough_mm, both]
                }
                _ => [0.0; 2],
            };
            [
                -amplitude_mm * deepest * rest - around[0],
                amplitude_mm * deepest * (1.0 - rest) + around[1],
            ]
        })
    }

    /// Amplitude and lag of a mode.
    fn mode(&self, mode: usize) -> (f64, f64) {
        let b = &self.breathing;
        match mode {
            THORAX => (b.thorax_mm, b.thorax_lag),
            ABDOMEN => (b.abdomen_mm, 0.0),
            DIAPHRAGM => (b.diaphragm_mm, b.diaphragm_lag),
            LUNG => (b.lung_mm, b.lung_lag),
            _ => (0.0, 0.0),
        }
    }

    /// How strongly the patient coughs, 0 to 1.
    fn cough(&self, time_s: f64) -> f64 {
        let draws = Draws::new(self.seed, COUGH);
        let slot = (time_s / SLOT_S).floor();
        let chance = self.treatment.coughs_per_min * SLOT_S / 60.0;
        let index = 2 * slot as i64;
        let by_chance = (draws.unit(index) < chance)
            .then(|| slot * SLOT_S + draws.unit(index + 1) * (SLOT_S - COUGH_S));
        let stated = self.treatment.coughs_at_s.iter().copied();
        // Coughs that meet do not add up to more than one.
        let rest: f64 = by_chance
            .into_iter()
            .chain(stated)
            .map(|start| 1.0 - bursts(time_s - start))
            .product();
        1.0 - rest
    }
}

/// cos^2n(pi phase).
fn course(phase: f64, exponent: u32) -> f64 {
    (PI * phase).cos().powi(2 * exponent as i32)
}

/// A cough that began so long ago: sin^2 bursts.
fn bursts(since_s: f64) -> f64 {
    (BURSTS.iter())
        .map(|(start, height)| {
            let into = ((since_s - start) / BURST_S).clamp(0.0, 1.0);
            height * (PI * into).sin().powi(2)
        })
        .sum()
}

#[cfg(test)]
mod tests {
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

    /// The area that two lagged courses go around, by the Fourier series of cos^2n: coefficients
    /// 2 C(2n, n - k) / 4^n, and pi k c_k^2 sin(2 pi k lag) of area each.
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
        // The bounds are not idle.
        for k in 0..MODES {
            let [range, used] = [bounds[k], seen[k]].map(|[a, b]| b - a);
            assert!(used > 0.4 * range, "{k}: {used} of {range}");
        }
        // Slopes from both sides agree where coughs, slots and knots meet.
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
        // Ends of inhaling, by bisection of what only grows.
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
}
