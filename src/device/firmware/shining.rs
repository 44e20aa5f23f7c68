//! The light source under commands and patterns, for profiles that model one.

use super::{Firmware, Settings};
use phasmid_profile::{Profile, Timing};
use phasmid_render::led::{Emission, Model, Source};
use std::ops::Range;
use std::sync::Arc;

/// A light source and its emission during the sequence exposed last.
pub(super) struct Shining {
    source: Source,
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

    /// Returns the emission that an exposure from `start_ns` on sees; `index` is the pattern's
    /// position in the sequence.
    fn expose(&mut self, index: Option<u32>, start_ns: u64) -> Arc<Emission> {
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

/// A pattern's period, and the part of it in which the pattern is shown, in nanoseconds of device
/// time.
pub(super) struct Period {
    all: Range<u64>,
    pub(super) lit: Range<u64>,
}

/// Output level requested by lamp and current.
fn level(settings: &Settings) -> f64 {
    match settings.lamp {
        true => settings.current,
        false => 0.0,
    }
}

impl Firmware {
    /// Makes the light source follow the settings from now on.
    pub(super) fn drive(&mut self) {
        if let Some(shining) = &mut self.shining {
            shining.source.drive(self.now_ns, level(&self.settings));
        }
    }

    /// Returns when a projector with timing shows the pattern of an exposure that starts at
    /// `start_ns`.
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

    /// Switches the source of a projector with timing off between the patterns of a sequence, for
    /// exposures that start at `starts_ns`, until `until_ns`. Between sequences the source is on.
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

    /// Returns the light source's emission for an exposure from `start_ns` on.
    pub(super) fn emission(&mut self, index: Option<u32>, start_ns: u64) -> Option<Arc<Emission>> {
        let shining = self.shining.as_mut()?;
        Some(shining.expose(index, start_ns))
    }

    /// Returns whether patterns affect the light: a source that was switched off still glows.
    pub(super) fn shows(&self) -> bool {
        self.settings.lamp || self.shining.is_some()
    }
}
