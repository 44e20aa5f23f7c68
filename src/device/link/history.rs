//! Metadata of the device's latest frames, for requests that refer to a frame after its exposure.

use crate::{Firmware, Shot};
use phasmid_protocol::faults::Struck;
use phasmid_protocol::service::{FrameAbout, Objects, Shown};
use std::collections::VecDeque;

/// Maximum number of frames kept.
const MAX_FRAMES: usize = 4096;

/// Metadata of an exposed frame.
#[derive(Debug, Clone)]
pub(super) struct Taken {
    id: u64,
    pattern_index: Option<u32>,
    shown: Option<Shown>,
    light: f64,
    gain_db: f64,
    start_ns: u64,
    exposure_ns: u64,
    end_ns: u64,
    /// Version of the scene at the time of the exposure.
    pub(super) version: u64,
}

impl Taken {
    /// Returns the middle of the exposure in nanoseconds of device time.
    pub(super) fn middle_ns(&self) -> u64 {
        self.start_ns + self.end_ns.saturating_sub(self.start_ns) / 2
    }

    /// Combines the metadata with the objects of the scene at the time of the frame and the faults
    /// that struck the frame.
    pub(super) fn about(self, scene: Objects, faults: Vec<Struck>) -> FrameAbout {
        FrameAbout {
            id: self.id,
            pattern_index: self.pattern_index,
            shown: self.shown,
            light: self.light,
            gain_db: self.gain_db,
            start_ns: self.start_ns,
            exposure_ns: self.exposure_ns,
            end_ns: self.end_ns,
            faults,
            scene,
        }
    }
}

/// The latest frames, ordered by id.
#[derive(Debug, Default)]
pub(super) struct History {
    frames: VecDeque<Taken>,
}

impl History {
    /// Adds the frame of an exposure; `version` is the version of the scene.
    pub(super) fn push(&mut self, shot: &Shot, firmware: &Firmware, version: u64) {
        if self.frames.len() == MAX_FRAMES {
            self.frames.pop_front();
        }
        self.frames.push_back(Taken {
            id: shot.id,
            pattern_index: shot.pattern_index,
            shown: {
                let pattern_image = shot.pattern_image.as_ref();
                pattern_image.map(|pattern_image| firmware.shown(pattern_image, shot.pattern_index))
            },
            light: shot.light,
            gain_db: shot.gain_db,
            start_ns: shot.start_ns,
            exposure_ns: shot.exposure_ns,
            end_ns: shot.end_ns(),
            version,
        });
    }

    /// Returns the number of frames kept.
    pub(super) fn len(&self) -> usize {
        self.frames.len()
    }

    /// Returns a frame by its id.
    ///
    /// # Errors
    /// Returns an error, worded for the reply, if the frame has been dropped or not been exposed
    /// yet.
    pub(super) fn find(&self, id: u64) -> Result<&Taken, String> {
        let found = self.frames.binary_search_by_key(&id, |taken| taken.id);
        found.map(|at| &self.frames[at]).map_err(|_| {
            match (self.frames.front(), self.frames.back()) {
                (Some(first), Some(last)) => {
                    format!("truth_of_frame: {id}; expected {} to {}", first.id, last.id)
                }
                _ => format!(
                    "truth_of_frame: no frame has been exposed yet, found {id}; expected the id of \
                     an exposed frame"
                ),
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_profile::Profile;

    #[test]
    fn history_finds_only_the_last_frames() {
        let firmware = Firmware::new(&Profile::load("webcam-grey").unwrap(), &[]).unwrap();
        let mut history = History::default();
        assert_eq!(
            history.find(7).unwrap_err(),
            "truth_of_frame: no frame has been exposed yet, found 7; expected the id of an exposed \
             frame"
        );
        let sequence = firmware.selected_sequence();
        for id in 0..5000 {
            let (_, shot) = &sequence[id % sequence.len()];
            let shot = Shot {
                id: id as u64,
                start_ns: id as u64 * 100,
                exposure_ns: 51,
                ..shot.clone()
            };
            history.push(&shot, &firmware, 7);
        }
        assert_eq!(history.len(), MAX_FRAMES);
        let words = history.find(903).unwrap_err();
        assert_eq!(words, "truth_of_frame: 903; expected 904 to 4999");
        assert!(history.find(5000).is_err());
        let taken = history.find(4000).unwrap();
        assert_eq!((taken.middle_ns(), taken.version), (400_025, 7));
        let shown = taken.shown.clone().unwrap();
        let at = 4000 % sequence.len();
        assert_eq!(shown.index, Some(at as u32));
        assert_eq!(shown.pattern, Some(sequence[at].0.clone()));
    }
}
