//! Coughs of three bursts each, at given times and at random.

use super::Course;
use crate::random::Draws;
use std::f64::consts::PI;

/// Random stream of the coughs.
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
    pub(super) fn cough(&self, time_s: f64) -> f64 {
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
