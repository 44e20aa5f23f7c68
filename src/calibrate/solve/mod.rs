//! From sightings of a board to a rig, with a covariance that can be believed.
//!
//! Homographies give the camera's lens and the boards' poses in closed form (`zhang`), the lit points
//! in space then the projector (`resection`); what is no board's picture is left out on the way
//! (`start`). Bundle adjustment (`bundle`, `fit`, `normal`) brings all unknowns to the minimum of
//! the whitened residuals (`observation`), first by a robust loss, then by plain squares without the
//! outliers (`robust`), in the model that the data demand (`coefficients`). The inverse of the
//! normal matrix is the covariance; where residuals are larger than the given covariances allow,
//! these are inflated first. `check` says what a user should know.

mod belonging;
mod bundle;
mod check;
mod chi_square;
mod coefficients;
mod fit;
mod homography;
mod model;
mod normal;
mod observation;
mod place;
mod refusal;
mod resection;
mod robust;
mod rotation;
mod solution;
mod start;
mod start_projector;
mod summary;
#[cfg(test)]
mod tests;
mod unsolved;
mod zhang;

pub use chi_square::{chi_square_below, chi_square_bound};

pub use place::{Placed, place};
pub use solution::{
    Errors, LeftOut, Parameter, PointResidual, ProjectorResidual, Solution, SolvedPose,
};
pub use unsolved::Unsolved;

use super::board::Sighting;
use phasmid_geometry::Board;

/// The covariance of so many poses takes 72 MB.
const MOST_POSES: usize = 500;

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
    /// As many as the data demand of none, k1, k1 k2, k1 k2 p1 p2 and all five, by the Bayesian
    /// information criterion.
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
    board: &Board,
    poses: &[PoseSightings],
    camera_px: [u32; 2],
    projector_px: [u32; 2],
    choice: &Choice,
) -> Result<Solution, Unsolved> {
    if poses.len() > MOST_POSES {
        return Err(Unsolved::TooManyPoses {
            found: poses.len().to_string(),
            wanted: format!("{MOST_POSES} or fewer"),
        });
    }
    let mut bundle = bundle::Bundle::new(board, poses);
    let solved = bundle.solve([camera_px, projector_px], choice)?;
    let mut solution = summary::of(bundle, solved);
    check::refuse(&solution)?;
    solution.warnings = check::warnings(&solution, poses, choice);
    Ok(solution)
}
