//! Weights of the motion modes over time, computed for any time independently and reproducibly for
//! a seed.
//!
//! A cycle follows cos^2n(pi phase) (Lujan et al., Medical Physics 26, 1999), with 1 at end-inhale
//! (phase 0, as in a 4D-CT) and 0 at end-exhale (phase 0.5), where breathing rests longer for
//! larger n. Each mode follows with its own lag, so that a tumour moves on a loop, both in itself
//! and relative to the skin: Seppenwoolde et al., Int. J. Radiation Oncology 53, 2002, saw 1 to 5
//! mm between a tumour's inhale and exhale paths in half of 21 patients, and 12 mm of motion along
//! the body in lower lobes. Ranges of diaphragm motion and periods: Keall et al., AAPM report 91
//! (task group 76), Medical Physics 33, 2006. Coughs of three bursts each come at given times and at
//! random.

#[cfg(test)]
mod tests;

use super::modes::{ABDOMEN, DIAPHRAGM, LUNG, MODES, POSTURE, THORAX};
use super::parameters::{Breathing, Patient, Treatment};
use super::random::Draws;
use super::spline::{most_of, most_of_differences, wander};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// End-exhale, the reference phase at planning, where all weights are 0: phase 50 of a 4D-CT.
pub const REFERENCE_PHASE: usize = 5;
/// Number of phases of a 4D-CT.
pub const PHASES: usize = 10;

/// Random-number stream for the phase over time.
const PHASE: u32 = 10;
/// Random-number stream for the depth of cycles.
const DEPTH: u32 = 11;
/// Random-number stream for the first mode's own depth; the other modes use the streams after it.
const OWN: u32 = 12;
/// Random-number stream for the wandering baseline.
const BASELINE: u32 = 20;
/// Time scale of the baseline's wander, in seconds.
const WANDER_S: f64 = 15.0;
/// Drift of the thorax as a fraction of the abdomen's drift.
const THORAX_DRIFT: f64 = 0.4;
/// Upward motion of the diaphragm during a cough as a fraction of the abdomen's inward motion.
const THROWN_UP: f64 = 0.5;

/// Planning or treatment day.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Day {
    /// The mean cycle, repeated exactly, as binned by a 4D-CT.
    Planning,
    /// Varying cycles, drift, coughs, posture and set-up errors.
    Treatment,
}

/// Breathing of one patient over time.
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

    /// Returns the number of cycles elapsed at a time in seconds; phase 0 is end-inhale.
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

    /// Returns the weights of the mean cycle at a phase, in millimetres; 0 at phase 0.5.
    pub(super) fn mean(&self, phase: f64) -> [f64; MODES] {
        std::array::from_fn(|mode| {
            let (amplitude_mm, lag) = self.mode(mode);
            let rest = course(0.5 - lag, self.breathing.exponent);
            amplitude_mm * (course(phase - lag, self.breathing.exponent) - rest)
        })
    }

    /// Returns the weights on a day at a time, in millimetres.
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

    /// Returns bounds of the weights over all times of both days, in millimetres.
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

    /// Returns amplitude and lag of a mode.
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
}

/// cos^2n(pi phase).
fn course(phase: f64, exponent: u32) -> f64 {
    (PI * phase).cos().powi(2 * exponent as i32)
}

/// Random-number stream for the coughs.
const COUGH: u32 = 21;
/// Length of a time slot, which contains at most one random cough.
const SLOT_S: f64 = 10.0;
/// Start time in seconds and relative strength of the bursts of a cough.
const BURSTS: [(f64, f64); 3] = [(0.0, 1.0), (0.45, 0.8), (0.9, 0.55)];
/// Duration of a burst in seconds.
const BURST_S: f64 = 0.5;
/// Duration of a cough in seconds.
const COUGH_S: f64 = 1.4;

impl Course {
    /// Strength of coughing, 0 to 1.
    fn cough(&self, time_s: f64) -> f64 {
        let draws = Draws::new(self.seed, COUGH);
        let slot = (time_s / SLOT_S).floor();
        let chance = self.treatment.coughs_per_min * SLOT_S / 60.0;
        let index = 2 * slot as i64;
        let by_chance = (draws.unit(index) < chance)
            .then(|| slot * SLOT_S + draws.unit(index + 1) * (SLOT_S - COUGH_S));
        let stated = self.treatment.coughs_at_s.iter().copied();
        // Overlapping coughs never add up to more than one.
        let rest: f64 = by_chance
            .into_iter()
            .chain(stated)
            .map(|start| 1.0 - bursts(time_s - start))
            .product();
        1.0 - rest
    }
}

/// Strength of a cough that started `since_s` seconds ago: sin^2 bursts.
fn bursts(since_s: f64) -> f64 {
    (BURSTS.iter())
        .map(|(start, height)| {
            let into = ((since_s - start) / BURST_S).clamp(0.0, 1.0);
            height * (PI * into).sin().powi(2)
        })
        .sum()
}
