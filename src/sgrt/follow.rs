//! Tracks a patient from scan to scan, starting each fit at the previous result.

use super::fit::{FitOptions, MotionFit, MotionState, MotionTracker};
use super::measured::Measured;
use super::planned::Planned;
use super::rigid::{RigidFit, RigidOptions, Start, track_rigid};
use super::warning::Lost;
use phasmid_core::error::Result;
use phasmid_geometry::Pose;

/// Tracks a patient who was set up by hand.
pub struct Follower<'a> {
    planned: &'a Planned,
    tracker: MotionTracker<'a>,
    start: Start,
    state: MotionState,
}

/// The pose of the skin and the position of the tumour.
pub struct Answers {
    /// The six degrees of freedom of the skin.
    pub rigid: std::result::Result<RigidFit, Lost>,
    /// The tumour's position from the motion model.
    pub motion: std::result::Result<MotionFit, Lost>,
}

impl<'a> Follower<'a> {
    /// Creates a follower from planning data.
    ///
    /// # Errors
    /// Returns the errors of [`MotionTracker::new`].
    pub fn new(planned: &'a Planned) -> Result<Self> {
        let options = FitOptions::by_hand();
        let (reference, model) = (&planned.reference, &planned.model);
        Ok(Self {
            planned,
            tracker: MotionTracker::new(reference, model, Pose::IDENTITY, &options)?,
            start: Start::SET_UP,
            state: MotionState::mean(model),
        })
    }

    /// Computes both answers for a scan, in parallel.
    pub fn answer(&mut self, measured: &Measured) -> Answers {
        let (reference, options) = (&self.planned.reference, RigidOptions::default());
        let (rigid, motion) = rayon::join(
            || track_rigid(measured, reference, &self.start, &options),
            || self.tracker.fit(measured, &self.state),
        );
        if let Ok(rigid) = &rigid {
            self.start = Start::Near(rigid.room_from_reference);
        }
        self.state = match &motion {
            Ok(motion) => motion.state.clone(),
            Err(_) => MotionState::mean(&self.planned.model),
        };
        Answers { rigid, motion }
    }
}
