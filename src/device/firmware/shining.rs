//! What the light source does while commands and patterns drive it, where the profile has one.

use super::{Firmware, Settings};
use phasmid_profile::{Profile, Timing};
use phasmid_render::led::{Emission, Model, Source};
use std::ops::Range;
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
    fn expose(&mut self, index: Option<u32>, start_ns: u64) -> Arc<Emission> {
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

    /// What the patterns saw that were exposed last.
    pub(super) fn all(&self) -> &[Arc<Emission>] {
        &self.taken
    }

    /// The sequence is the earlier one again.
    pub(super) fn put_back(&mut self, taken: Vec<Arc<Emission>>) {
        self.taken = taken;
    }

    /// The sequence is another one.
    pub(super) fn forget(&mut self) {
        self.taken.clear();
    }
}

/// A pattern's period, and when in it the pattern is shown, in nanoseconds of device time.
pub(super) struct Period {
    all: Range<u64>,
    pub(super) lit: Range<u64>,
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

    /// When the pattern of an exposure that starts at a time is shown, by a projector that has a time.
    pub(super) fn period(&self, timing: &Timing, start_ns: u64) -> Period {
        let period_ns = self.settings.period_ns;
        let begins_ns = start_ns.saturating_sub(timing.camera_delay_ns());
        let from_ns = begins_ns.saturating_add(timing.dark_before_ns());
        let to_ns = from_ns.saturating_add(self.settings.pattern_ns(timing, period_ns));
        Period {
            all: begins_ns..begins_ns.saturating_add(period_ns),
            lit: from_ns..to_ns,
        }
    }

    /// Has a projector that has a time switch its source off while patterns of a sequence are not
    /// shown, of exposures that start at these times, until a time. Between sequences it is on.
    pub(super) fn open(&mut self, starts_ns: impl Iterator<Item = u64>, until_ns: u64) {
        let Some(timing) = &self.profile.projector.timing else {
            return;
        };
        let periods: Vec<_> = starts_ns
            .take_while(|start_ns| *start_ns <= until_ns)
            .map(|start_ns| self.period(timing, start_ns))
            .collect();
        let Some(shining) = &mut self.shining else {
            return;
        };
        for Period { all, lit } in periods {
            shining.source.open(all.start, false);
            shining.source.open(lit.start, true);
            shining.source.open(lit.end, false);
            shining.source.open(all.end, true);
        }
    }

    /// What an exposure from a time on sees of the light source.
    pub(super) fn emission(&mut self, index: Option<u32>, start_ns: u64) -> Option<Arc<Emission>> {
        let shining = self.shining.as_mut()?;
        Some(shining.expose(index, start_ns))
    }

    /// Whether patterns are in the light's path: a source that has been switched off still glows.
    pub(super) fn shows(&self) -> bool {
        self.settings.lamp || self.shining.is_some()
    }
}
