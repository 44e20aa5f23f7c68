//! The light source of a profile that models one, and the light that it has emitted.

use super::settings::Settings;
use phasmid_profile::Profile;
use phasmid_render::led::{Emission, Model, Source};
use std::sync::Arc;

/// A light source, and its emission during each pattern of the sequence exposed last.
pub(super) struct Shining {
    pub(super) source: Source,
    taken: Vec<Arc<Emission>>,
}

impl Shining {
    /// Returns the profile's light source, switched on cold at time 0.
    pub(super) fn new(profile: &Profile, settings: &Settings) -> Option<Self> {
        let model = Model::new(profile.projector.led.as_ref()?);
        let mut source = Source::new(model);
        source.drive(0, level(settings));
        let taken = Vec::new();
        Some(Self { source, taken })
    }

    /// Returns the emission that an exposure from `start_ns` on sees, and stores it for the pattern
    /// at position `index` of the sequence.
    pub(super) fn expose(&mut self, index: Option<u32>, start_ns: u64) -> Arc<Emission> {
        let emission = self.source.emission(start_ns);
        if let Some(index) = index {
            self.taken.truncate(index as usize);
            self.taken.push(emission.clone());
        }
        emission
    }

    /// Returns the emission that the pattern at `index` saw in the last run, if all `count`
    /// patterns were exposed.
    pub(super) fn taken(&self, index: usize, count: usize) -> Option<Arc<Emission>> {
        let all = self.taken.len() == count;
        self.taken.get(index).filter(|_| all).cloned()
    }

    /// Returns the emissions seen by the patterns exposed last.
    pub(super) fn all(&self) -> &[Arc<Emission>] {
        &self.taken
    }

    /// Restores the emissions of an earlier sequence.
    pub(super) fn put_back(&mut self, taken: Vec<Arc<Emission>>) {
        self.taken = taken;
    }

    /// Discards the emissions when another sequence is selected.
    pub(super) fn forget(&mut self) {
        self.taken.clear();
    }
}

/// Returns the output level that the lamp and current settings request, 0 to 1.
pub(super) fn level(settings: &Settings) -> f64 {
    match settings.lamp {
        true => settings.current,
        false => 0.0,
    }
}
