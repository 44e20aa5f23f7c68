//! From pictures of a board in many poses to a calibrated rig.
//!
//! [`sight`] takes from each pose what the rest needs, so that frames and maps can go: the board's
//! points in the picture, and fits of the projector's coordinates about each. [`calibrate`] solves
//! for the rig. The centroid of a dot's image is not the image of its centre, and by how much it is
//! off takes the lens and the pose, which are what is wanted; so it solves with the centroids as
//! they are, moves them by what the solution says ([`super::board::bias`]), reads the projector's
//! coordinates anew at the moved points, and solves again, until they stay. [`place`] does the same
//! where the rig is known and only the board's place is not.

mod checks;
mod place;
mod rounds;
mod sight;

pub use place::place;
pub use rounds::calibrate;
pub use sight::{PoseData, sight};

use super::solve::{Choice, PoseSightings, Solution};
use phasmid_geometry::{Board, NoiseModel, Rig};

/// What a calibration is of, and what is known beforehand.
#[derive(Debug, Clone, Copy)]
pub struct Task<'a> {
    /// The board that was shown.
    pub board: &'a Board,
    /// Width and height of the camera's image.
    pub camera_px: [u32; 2],
    /// Width and height of the projector's image.
    pub projector_px: [u32; 2],
    /// What the device says of itself, if it does: the result is held against it.
    pub nominal: Option<&'a Rig>,
    /// The camera's noise, which the resulting rig carries.
    pub noise: Option<NoiseModel>,
    /// Which coefficients are estimated.
    pub choice: Choice,
}

/// A pose without a board that could be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Missed {
    /// What the user calls the pose.
    pub name: String,
    /// What was found in place of the board.
    pub why: String,
}

/// A rig that was calibrated, and all that a report says of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// The board that was shown.
    pub board: Board,
    /// The rig, noise model included, the poses that were used and how well all of it is known.
    pub solution: Solution,
    /// What the solver was given, in the order of poses: the places `given` of the solution's poses
    /// and of those left out count in here. Dots are freed of the bias of their outlines.
    pub sightings: Vec<PoseSightings>,
    /// Poses in which no board was found.
    pub missed: Vec<Missed>,
    /// How often it was solved.
    pub rounds: usize,
    /// The longest way that a point went from its centroid, in pixels.
    pub largest_bias_px: f64,
    /// The longest way that a point would go after the last round, in pixels.
    pub last_move_px: f64,
    /// What a user should know before trusting this, with numbers: the solver's warnings and those
    /// of comparing with the nominal rig.
    pub warnings: Vec<String>,
}

#[cfg(test)]
mod tests;
