//! Steps and means of the light source under a constant drive, exact for any length of a step.

use super::integrals::{Decay, both_gone, both_left, left_and_gone};
use phasmid_profile::Led;

/// The constants of a light source, in nanoseconds.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    rise_ns: f64,
    /// Of each part that warms: its time constant, and the share of the light that it costs.
    droop: Vec<(f64, f64)>,
    /// Share of the light that is left when all is warm.
    kept: f64,
}

/// Where a light source stands.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct State {
    /// Emission relative to full current, before what heat costs.
    pub(super) emission: f64,
    /// Heat of each part relative to what full current makes of it.
    pub(super) heat: [f64; Led::MAX_DROOPS],
}

impl Model {
    /// Of a profile's light source.
    pub fn new(led: &Led) -> Self {
        let droop = led.droop.iter().take(Led::MAX_DROOPS);
        let droop = droop.map(|droop| (droop.time_constant_s * 1e9, droop.fraction));
        // From 10 to 90 per cent of 1 - exp(-t / T) it takes T ln 9.
        Self::of(led.rise_us * 1e3 / 9f64.ln(), droop.collect())
    }

    /// Of time constants in nanoseconds.
    pub(super) fn of(rise_ns: f64, droop: Vec<(f64, f64)>) -> Self {
        let lost: f64 = droop.iter().map(|(_, share)| share).sum();
        Self {
            rise_ns,
            droop,
            kept: 1.0 - lost,
        }
    }

    /// A source that is cold and dark.
    pub fn off(&self) -> State {
        State::default()
    }

    /// One that has been driven at a level for ever.
    pub fn settled(&self, drive: f64) -> State {
        State {
            emission: drive,
            heat: [drive; Led::MAX_DROOPS],
        }
    }

    /// The light of a state, relative to that of a cold source at full current.
    pub fn light(&self, state: &State) -> f64 {
        let droop = self.droop.iter().zip(&state.heat);
        let cool: f64 = droop.map(|((_, share), heat)| share * (1.0 - heat)).sum();
        state.emission * (self.kept + cool)
    }

    /// The state after a step of so many nanoseconds at a drive from 0 to 1.
    pub fn after(&self, state: &State, drive: f64, step_ns: f64) -> State {
        let towards = |from: f64, constant: f64| {
            let decay = Decay::new(step_ns, constant);
            // Rounding must not make it warmer than warm.
            (from * decay.left + drive * decay.gone).min(1.0)
        };
        let mut next = State {
            emission: towards(state.emission, self.rise_ns),
            ..*state
        };
        for (heat, (constant, _)) in next.heat.iter_mut().zip(&self.droop) {
            *heat = towards(*heat, *constant);
        }
        next
    }

    /// The mean of the light over such a step; the light itself over a step of 0. Its relative error
    /// is below 1e-14.
    pub fn mean(&self, state: &State, drive: f64, step_ns: f64) -> f64 {
        let (from, rest) = (state.emission, 1.0 - drive);
        let rise = Decay::new(step_ns, self.rise_ns);
        let steady = from * rise.mean_left() + drive * rise.mean_gone();
        let cool: f64 = self
            .droop
            .iter()
            .zip(&state.heat)
            .map(|((constant, share), heat)| {
                let warming = Decay::new(step_ns, *constant);
                let cool = 1.0 - heat;
                let mut mean = from * cool * both_left(&rise, &warming)
                    + from * rest * left_and_gone(&rise, &warming)
                    + drive * cool * left_and_gone(&warming, &rise);
                if drive > 0.0 && rest > 0.0 {
                    mean += drive * rest * both_gone(&rise, &warming);
                }
                share * mean
            })
            .sum();
        self.kept * steady + cool
    }
}
