//! Surface-guided radiotherapy: tracks a patient by the skin, locates the tumour and gates the beam.
//!
//! Planning provides what is known of a patient: a [`Reference`] surface, and the displacements of
//! skin and tumour at the phases of breathing, from which a [`MotionModel`] is built. A scan provides
//! [`Measured`] points from one or more pods.
//!
//! - [`track_rigid`] finds the six degrees of freedom of the skin in a region of interest.
//! - [`MotionTracker`] fits the motion model and reports the tumour's position.
//! - [`Sight`] turns a pod's frames into measured points, and [`Follower`] tracks them scan by scan.
//! - [`Hold`] decides from the readings of either tracker whether the beam may be on.
//!
//! Coordinates are millimetres in the room frame: the fixed frame of IEC 61217 with its origin at the
//! isocentre, x to the right as seen from the foot end towards the gantry, y to the gantry, z up. The
//! reference surface is given in this frame, in its planned position. Every result has a covariance,
//! and warnings where it is unreliable. Results do not depend on the number of threads.
//!
//! | file | content |
//! | --- | --- |
//! | `surface` | the reference surface: closest points, normals, curvature, region of interest |
//! | `measured`, `sight` | measured points; decoding a pod's frames into them |
//! | `rigid` | rigid tracking in six degrees of freedom; `six` converts poses to IEC 61217 angles |
//! | `model`, `fit` | the motion model (principal components) and its fit to a scan |
//! | `robust` | Tukey's biweight, residual scale and covariance inflation |
//! | `follow`, `planned` | scan-to-scan tracking; planning data in the room frame |
//! | `practice` | default settings for tracking a chest |
//! | `hold`, `warning` | beam hold; warnings and errors of the trackers |

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
pub use practice::POINTS;
pub use rigid::{Freedom, RigidFit, RigidOptions, Start, track_rigid};
pub use sight::{PIXELS, Sight};
pub use six::SixDof;
pub use surface::{Foot, Reference, Region};
pub use warning::{Lost, ScanWarning, Warning};
