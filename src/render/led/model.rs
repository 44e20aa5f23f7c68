//! Steps and means of the light source under a constant drive, exact for any step length.

use super::integrals::{Decay, both_gone, both_left, left_and_gone};
use phasmid_profile::Led;

/// The constants of a light source, in nanoseconds.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    rise_ns: f64,
    /// Time constant in nanoseconds and fraction of light lost, for each part that warms up.
    droop: Vec<(f64, f64)>,
    /// Fraction of the light that remains at full heat.
    kept: f64,
}

/// State of a light source.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct State {
    /// Emission relative to full current, before thermal losses.
    pub(super) emission: f64,
    /// Heat of each part relative to its steady state at full current.
    pub(super) heat: [f64; Led::MAX_DROOPS],
}

impl Model {
    /// Creates the model of a profile's light source.
    pub fn new(led: &Led) -> Self {
        let droop = led.droop.iter().take(Led::MAX_DROOPS);
        let droop = droop.map(|droop| (droop.time_constant_s * 1e9, droop.fraction));
        // The emission 1 - exp(-t / T) takes T ln 9 to rise from 10 to 90 per cent.
        Self::of(led.rise_us * 1e3 / 9f64.ln(), droop.collect())
    }

    /// Creates a model from time constants in nanoseconds.
    pub(super) fn of(rise_ns: f64, droop: Vec<(f64, f64)>) -> Self {
        let lost: f64 = droop.iter().map(|(_, share)| share).sum();
        Self {
            rise_ns,
            droop,
            kept: 1.0 - lost,
        }
    }

    /// Returns the state of a cold, dark source.
    pub fn off(&self) -> State {
        State::default()
    }

    /// Returns the steady state at a drive level.
    pub fn settled(&self, drive: f64) -> State {
        State {
            emission: drive,
            heat: [drive; Led::MAX_DROOPS],
        }
    }

    /// Returns the light of a state, relative to a cold source at full current.
    pub fn light(&self, state: &State) -> f64 {
        let droop = self.droop.iter().zip(&state.heat);
        let cool: f64 = droop.map(|((_, share), heat)| share * (1.0 - heat)).sum();
        state.emission * (self.kept + cool)
    }

    /// Returns the state after a step of `step_ns` nanoseconds at a drive from 0 to 1.
    pub fn after(&self, state: &State, drive: f64, step_ns: f64) -> State {
        let towards = |from: f64, constant: f64| {
            let decay = Decay::new(step_ns, constant);
            // Rounding must not lift the state above the steady state.
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

    /// Returns the mean light over a step as in [`Self::after`]; for a step of 0, the light of
    /// `state`. The relative error is below 1e-14.
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
