//! Calibrates a rig from images of a board in many poses.
//!
//! [`sight`] extracts from each pose the board's points in the image and local fits of the
//! projector's coordinates about each point. After that, the pose's frames and maps can be freed.
//! [`calibrate`] solves for the rig.
//!
//! The centroid of a dot's image is not the image of the dot's centre. Their difference (the bias)
//! depends on the lens and the pose, which are the unknowns. So [`calibrate`] solves with the
//! centroids, corrects them by the bias of the solution ([`super::board::bias`]), evaluates the
//! projector's coordinates at the corrected points, and repeats until the points no longer move.
//! [`place`] does the same for the pose of a board with a known rig.
//!
//! - `look`: decodes and detects one pose
//! - `poses`: the poses of a calibration
//! - `sight`: detects the board in one pose and fits the projector's coordinates
//! - `rounds`: the loop that calibrates a rig and compares it with the nominal rig; the loop that
//!   locates one board with a known rig
//! - `unusable`: reasons why a pose cannot be used

mod look;
mod poses;
mod rounds;
mod sight;
mod unusable;

pub use look::{Looked, look, look_at_photograph, look_with_stop};
pub use poses::{Gathering, Poses};
pub use rounds::{calibrate, place};
pub use sight::{PoseData, sight};
pub use unusable::Unusable;

use super::solve::{Choice, PoseSightings, Solution};
use phasmid_core::Stop;
use phasmid_geometry::{Board, NoiseModel, Rig};

/// The input of a calibration, except the poses.
#[derive(Debug, Clone, Copy)]
pub struct Task<'a> {
    /// The calibration board.
    pub board: &'a Board,
    /// Width and height of the camera's image.
    pub camera_px: [u32; 2],
    /// Width and height of the projector's image.
    pub projector_px: [u32; 2],
    /// The device's nominal rig, if known; the result is compared with it.
    pub nominal: Option<&'a Rig>,
    /// The camera's noise model, copied to the resulting rig.
    pub noise: Option<NoiseModel>,
    /// Options of the solver: distortion coefficients to estimate, exclusion of outliers.
    pub choice: Choice,
    /// Request with which another thread ends the calibration early; it then returns
    /// [`Unsolved::Interrupted`](super::solve::Unsolved::Interrupted).
    pub stop: Option<&'a Stop>,
}

/// A pose in which no usable board was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Missed {
    /// Name of the pose.
    pub name: String,
    /// Reason.
    pub why: Unusable,
}

/// A calibrated rig and everything the report contains.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// The calibration board.
    pub board: Board,
    /// The rig with its noise model, the poses that were used, and the uncertainty of both.
    pub solution: Solution,
    /// The solver's input. The field `given` of used and excluded poses is an index into this list.
    /// Dot positions are corrected for their bias.
    pub sightings: Vec<PoseSightings>,
    /// Poses in which no board was found.
    pub missed: Vec<Missed>,
    /// Number of solver runs.
    pub rounds: usize,
    /// Largest bias correction of a point, in pixels.
    pub largest_bias_px: f64,
    /// Largest distance that a corrected point would move in one more solver run, in pixels.
    pub last_move_px: f64,
    /// Warnings about the reliability of the result: from the solver and from the comparison with
    /// the nominal rig.
    pub warnings: Vec<String>,
}

#[cfg(test)]
mod tests;
