//! All or nothing: what has been set is put back when a later message of the same request is refused,
//! as a request that was refused has changed nothing.

use super::memory::Stored;
use super::settings::Settings;
use super::{Firmware, State};
use phasmid_render::led::Emission;
use std::sync::Arc;

/// Settings, the selected sequence and the trigger system at an instant.
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
    /// What messages may set, as it is now.
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

    /// Puts that back, in the instant in which it was taken: nothing has been exposed since. What has
    /// been counted or cleared, and what is in the memory, stays as it is now.
    pub fn put_back(&mut self, before: Before) {
        let now = self.settings.clone();
        if self.apply(before.settings.clone()).is_err() {
            // A link that cannot go back keeps its frames; there is nobody to tell.
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
