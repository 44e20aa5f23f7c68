//! Weights of the modes over time: any moment by itself, the same for the same seed.
//!
//! A cycle follows cos^2n(pi phase) (Lujan et al., Medical Physics 26, 1999), 1 at the end of
//! inhaling (phase 0, as a 4D-CT counts) and 0 at the end of exhaling (phase 0.5), where breath
//! rests the longer the larger n is. Each mode follows it by a lag of its own, so that a tumour goes on
//! a loop, and on another beside the skin: Seppenwoolde et al., Int. J. Radiation Oncology 53, 2002,
//! saw 1 to 5 mm between a tumour's ways in and out in half of 21 patients, and 12 mm of motion along
//! the body in lower lobes. Ranges of diaphragms and periods: Keall et al., AAPM report 91 (task group
//! 76), Medical Physics 33, 2006.

mod cough;
#[cfg(test)]
mod tests;

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

/// Streams of numbers: course of the phase, depth of cycles, depth of each mode, baseline. Coughs have
/// one of their own.
const PHASE: u32 = 10;
const DEPTH: u32 = 11;
const OWN: u32 = 12;
const BASELINE: u32 = 20;
/// Time over which a baseline wanders.
const WANDER_S: f64 = 15.0;
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
}

/// cos^2n(pi phase).
fn course(phase: f64, exponent: u32) -> f64 {
    (PI * phase).cos().powi(2 * exponent as i32)
}
