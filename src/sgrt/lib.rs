//! Tracking a patient by the skin: where the patient lies, where the tumour is, whether to treat.
//!
//! All that this knows of a patient comes from planning: a [`Reference`] surface, and the
//! displacements of skin and tumour at the phases of breathing, from which a [`MotionModel`] is made.
//! All that it knows of now is [`Measured`], the points of a scan by one pod or several.
//!
//! - [`track_rigid`] finds the six degrees of freedom of the skin in a region of interest.
//! - [`MotionTracker`] fits the motion model, and says where the tumour is.
//! - [`Sight`] makes measured points of a pod's frames, and [`Follower`] tracks them scan by scan.
//! - [`Hold`] decides from readings of either when the beam may be on.
//!
//! Coordinates are millimetres in the room frame, that of IEC 61217 with its origin at the isocentre:
//! x to the right as seen from the foot end towards the gantry, y to the gantry, z up. The reference
//! surface stands in it as planned. Every answer comes with its covariance, and with warnings where it
//! is not to be relied on; results do not depend on the number of threads.

mod fit;
mod follow;
mod hold;
mod measured;
mod model;
mod planned;
mod practice;
mod rigid;
mod robust;
mod sight;
pub mod six;
mod surface;
#[cfg(test)]
mod testing;
mod warning;

pub use fit::{FitOptions, MotionFit, MotionState, MotionTracker, SetUp};
pub use follow::{Answers, Follower};
pub use hold::{Beam, Hold, HoldRules, Quantity, Reading, Reason};
pub use measured::Measured;
pub use model::{ModelOptions, MotionModel, Snapshots};
pub use planned::{Planned, room_from_patient};
pub use practice::{PIXELS, POINTS};
pub use rigid::{Freedom, RigidFit, RigidOptions, Start, track_rigid};
pub use sight::Sight;
pub use six::SixDof;
pub use surface::{Foot, Reference, Region};
pub use warning::{Lost, Warning};
