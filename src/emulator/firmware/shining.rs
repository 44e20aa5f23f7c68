//! What the light source does while commands and patterns drive it, where the profile has one.

use super::{Firmware, Settings};
use crate::emulator::led::{Emission, Model, Source};
use crate::profile::Profile;
use std::sync::Arc;

/// A light source, and what the sequence that was exposed last has seen of it.
pub(super) struct Shining {
    source: Source,
    taken: Vec<Arc<Emission>>,
}

impl Shining {
    /// The profile's, switched on cold at time 0.
    pub(super) fn new(profile: &Profile, settings: &Settings) -> Option<Self> {
        let model = Model::new(profile.projector.led.as_ref()?);
        let mut source = Source::new(model);
        source.drive(0, level(settings));
        let taken = Vec::new();
        Some(Self { source, taken })
    }

    /// What an exposure from a time on sees, of a pattern of the sequence where it has an index.
    pub(super) fn expose(&mut self, index: Option<u32>, start_ns: u64) -> Arc<Emission> {
        let emission = self.source.emission(start_ns);
        if let Some(index) = index {
            self.taken.truncate(index as usize);
            self.taken.push(emission.clone());
        }
        emission
    }

    /// What the pattern at an index saw when all of so many were exposed last.
    pub(super) fn taken(&self, index: usize, count: usize) -> Option<Arc<Emission>> {
        let all = self.taken.len() == count;
        self.taken.get(index).filter(|_| all).cloned()
    }

    /// The sequence is another one.
    pub(super) fn forget(&mut self) {
        self.taken.clear();
    }
}

/// What lamp and current ask for.
fn level(settings: &Settings) -> f64 {
    match settings.lamp {
        true => settings.current,
        false => 0.0,
    }
}

impl Firmware {
    /// Has the light source follow the settings from now on.
    pub(super) fn drive(&mut self) {
        if let Some(shining) = &mut self.shining {
            shining.source.drive(self.now_ns, level(&self.settings));
        }
    }

    /// Whether patterns are in the light's path: a source that has been switched off still glows.
    pub(super) fn shows(&self) -> bool {
        self.settings.lamp || self.shining.is_some()
    }
}
