//! What the service channel tells of the firmware: which pattern of the memory a slide is, and what
//! has been missed.

use super::Firmware;
use crate::Slide;
use phasmid_pattern::Pattern;
use phasmid_protocol::service::Shown;
use std::sync::Arc;

impl Firmware {
    /// Triggers since power-on or `*RST` that came too early.
    pub fn missed_triggers(&self) -> u64 {
        self.missed
    }

    /// The pattern that a slide is of. Where several show the same slide, it is the one of this index
    /// in the selected sequence, or another of it rather than of other sequences.
    pub fn shown(&self, slide: &Arc<Slide>, index: Option<u32>) -> Shown {
        for (rest, pattern) in [
            (&self.white, Pattern::White {}),
            (&self.black, Pattern::Black {}),
        ] {
            if Arc::ptr_eq(rest, slide) {
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
                    .slides
                    .get(*at)
                    .is_some_and(|s| Arc::ptr_eq(s, slide))
            };
            let first = index.into_iter().map(|index| index as usize);
            let mut places = first.chain(0..stored.slides.len());
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
