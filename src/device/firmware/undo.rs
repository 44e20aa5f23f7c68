//! All-or-nothing requests: if a later message of the same request is refused, earlier settings are
//! restored, since a refused request changes nothing.

use super::memory::Stored;
use super::settings::Settings;
use super::{Firmware, State};
use phasmid_render::led::Emission;
use std::sync::Arc;

/// Snapshot of the settings, the selected sequence and the trigger system.
#[derive(Debug, Clone)]
pub struct Before {
    settings: Settings,
    selected: Arc<Stored>,
    state: State,
    loaded_ns: u64,
    taken_ns: Vec<u64>,
    emitted: Option<Vec<Arc<Emission>>>,
}

impl Firmware {
    /// Returns a snapshot of everything that messages can set.
    pub fn before(&self) -> Before {
        Before {
            settings: self.settings.clone(),
            selected: self.selected.clone(),
            state: self.state,
            loaded_ns: self.loaded_ns,
            taken_ns: self.taken_ns.clone(),
            emitted: self.shining.as_ref().map(|shining| shining.all().to_vec()),
        }
    }

    /// Restores a snapshot at the same device time at which it was taken, so that nothing has been
    /// exposed since. Counters, cleared registers and the memory keep their present state.
    pub fn put_back(&mut self, before: Before) {
        let now = self.settings.clone();
        if self.apply(before.settings.clone()).is_err() {
            // A link that cannot change back keeps its format. The request already fails with
            // another error, so this error is not reported.
            self.settings = Settings {
                roi: now.roi,
                format: now.format,
                interval_ns: now.interval_ns,
                ..before.settings
            };
        }
        self.selected = before.selected;
        self.state = before.state;
        self.loaded_ns = before.loaded_ns;
        self.taken_ns = before.taken_ns;
        if let (Some(shining), Some(emitted)) = (&mut self.shining, before.emitted) {
            shining.put_back(emitted);
        }
        self.settle();
    }
}
