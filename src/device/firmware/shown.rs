//! Firmware state that the service channel reports: which stored pattern a pattern image shows, and
//! the number of missed triggers.

use super::Firmware;
use crate::PatternImage;
use phasmid_pattern::Pattern;
use phasmid_protocol::service::Shown;
use std::sync::Arc;

impl Firmware {
    /// Returns the number of triggers since power-on or `*RST` that came too early.
    pub fn missed_triggers(&self) -> u64 {
        self.missed
    }

    /// Returns the pattern that a pattern image shows. If several patterns share the pattern image,
    /// the one at `index` of the selected sequence is preferred, then others of that sequence.
    pub fn shown(&self, pattern_image: &Arc<PatternImage>, index: Option<u32>) -> Shown {
        for (rest, pattern) in [
            (&self.white, Pattern::White {}),
            (&self.black, Pattern::Black {}),
        ] {
            if Arc::ptr_eq(rest, pattern_image) {
                return Shown {
                    sequence: None,
                    index: None,
                    pattern: Some(pattern),
                };
            }
        }
        let others = self.memory.sequences();
        for stored in std::iter::once(&self.selected).chain(others) {
            let is = |at: &usize| {
                stored
                    .pattern_images
                    .get(*at)
                    .is_some_and(|s| Arc::ptr_eq(s, pattern_image))
            };
            let first = index.into_iter().map(|index| index as usize);
            let mut places = first.chain(0..stored.pattern_images.len());
            if let Some(at) = places.find(is) {
                let frame = stored.manifest.frame.get(at);
                return Shown {
                    sequence: Some(stored.name.clone()),
                    index: Some(at as u32),
                    pattern: frame.map(|frame| frame.pattern.clone()),
                };
            }
        }
        Shown {
            sequence: None,
            index: None,
            pattern: None,
        }
    }
}
