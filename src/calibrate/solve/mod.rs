//! From sightings of a board to a rig, with a covariance that can be believed.

mod solution;
mod unsolved;

pub use solution::{
    Errors, LeftOut, Parameter, PointResidual, ProjectorResidual, Solution, SolvedPose,
};
pub use unsolved::Unsolved;

use super::board::Sighting;
use crate::geometry::Board;

/// What is known of the board in one pose.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseSightings {
    /// What the user calls the pose (a folder's name, say).
    pub name: String,
    /// The points seen, in any order, each index once.
    pub sightings: Vec<Sighting>,
}

/// Which distortion coefficients are estimated; the others stay zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Coefficients {
    /// As many as the data demand.
    #[default]
    Auto,
    /// These of k1, k2, p1, p2, k3.
    Fixed([bool; 5]),
}

/// What is left to the user.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Choice {
    /// The camera's coefficients.
    pub camera: Coefficients,
    /// The projector's coefficients.
    pub projector: Coefficients,
    /// Whether points and poses that do not fit the rest are left out; else all count alike.
    pub robust: bool,
}

impl Default for Choice {
    fn default() -> Self {
        Self {
            camera: Coefficients::Auto,
            projector: Coefficients::Auto,
            robust: true,
        }
    }
}

/// Solves for the rig and every board's pose. The rig's frame is the camera's.
///
/// `camera_px` and `projector_px` are widths and heights of their images.
///
/// # Errors
/// What leaves a part of the rig undetermined.
pub fn solve(
    _board: &Board,
    poses: &[PoseSightings],
    _camera_px: [u32; 2],
    _projector_px: [u32; 2],
    _choice: &Choice,
) -> Result<Solution, Unsolved> {
    Err(Unsolved::TooFewPoses {
        found: format!("{} poses", poses.len()),
        wanted: "a solver".to_owned(),
    })
}
