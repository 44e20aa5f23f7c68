//! Solves for the rig, its distortion coefficients and the board poses, with a covariance.
//!
//! Steps:
//!
//! - Homographies give the camera's intrinsics and the board poses in closed form. The illuminated
//!   points, now known in space, then give the projector. Poses without a usable board are
//!   excluded.
//! - Bundle adjustment minimises the whitened residuals over all unknowns: first with a robust
//!   loss, then with plain least squares and without the outliers, in the distortion model that the
//!   data support.
//! - The inverse of the normal matrix is the covariance. If residuals exceed what the given
//!   covariances of the points explain, those are inflated first.
//!
//! | Files | Contents |
//! | --- | --- |
//! | `homography`, `zhang`, `resection` | closed-form estimates |
//! | `start`, `start_projector` | initial state; exclusion of unusable poses |
//! | `observation`, `model` | whitened observations, predictions, derivatives |
//! | `normal`, `fit`, `robust` | normal equations, Levenberg-Marquardt, robust loss and outliers |
//! | `coefficients`, `belonging` | choice of distortion model; exclusion of inconsistent poses |
//! | `bundle` | the sequence of these steps |
//! | `place` | pose of one board for a known rig |
//! | `solution`, `summary`, `check` | the result, its assembly, and warnings |
//! | `unsolved`, `refusal` | the error type and its diagnosis |
//! | `chi_square` | the chi-square distribution |

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
mod solution;
mod start;
mod start_projector;
mod summary;
#[cfg(test)]
mod tests;
mod unfit;
mod unsolved;
mod zhang;

pub use chi_square::{chi_square_below, chi_square_bound};

pub use place::{Placed, place};
pub use solution::{
    Errors, LeftOut, Parameter, PointResidual, ProjectorResidual, Solution, SolvedPose,
};
pub use unfit::Unfit;
pub use unsolved::Unsolved;

use super::board::Sighting;
use phasmid_core::Stop;
use phasmid_geometry::Board;
use phasmid_geometry::board_poses::MOST_POSES;

/// The observed board points of one pose.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseSightings {
    /// Name of the pose, for example its folder's name.
    pub name: String,
    /// Observed points in any order; each index occurs once.
    pub sightings: Vec<Sighting>,
}

/// Which distortion coefficients are estimated; the others stay zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Coefficients {
    /// Chooses among none, k1, k1 k2, k1 k2 p1 p2 and all five, by the Bayesian information
    /// criterion.
    #[default]
    Auto,
    /// Estimates the coefficients set to true, in the order k1, k2, p1, p2, k3.
    Fixed([bool; 5]),
}

/// Options of the solver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Choice {
    /// Coefficients of the camera to estimate.
    pub camera: Coefficients,
    /// Coefficients of the projector to estimate.
    pub projector: Coefficients,
    /// Whether to exclude outlier points and inconsistent poses. If false, all have equal standing.
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

/// Solves for the rig and the pose of every board. The rig's frame is the camera's frame.
///
/// `camera_px` and `projector_px` are the widths and heights of the two images.
///
/// # Errors
/// Returns an error if there are too many poses, or if the observations do not determine the rig.
pub fn solve(
    board: &Board,
    poses: &[PoseSightings],
    camera_px: [u32; 2],
    projector_px: [u32; 2],
    choice: &Choice,
) -> Result<Solution, Unsolved> {
    let stop = Stop::default();
    solve_with_stop(board, poses, camera_px, projector_px, choice, &stop)
}

/// [`solve`], which another thread can end early.
///
/// # Errors
/// Returns [`Unsolved::Interrupted`] soon after `stop` is asked, and the errors of [`solve`].
pub fn solve_with_stop(
    board: &Board,
    poses: &[PoseSightings],
    camera_px: [u32; 2],
    projector_px: [u32; 2],
    choice: &Choice,
    stop: &Stop,
) -> Result<Solution, Unsolved> {
    stop.check().map_err(|_| Unsolved::Interrupted)?;
    if poses.len() > MOST_POSES {
        return Err(Unsolved::TooManyPoses {
            found: poses.len().to_string(),
            wanted: format!("{MOST_POSES} or fewer"),
        });
    }
    let mut bundle = bundle::Bundle::new(board, poses);
    bundle.stop = stop.clone();
    let solved = bundle.solve([camera_px, projector_px], choice)?;
    let mut solution = summary::of(bundle, solved);
    check::refuse(&solution)?;
    solution.warnings = check::warnings(&solution, poses, choice);
    Ok(solution)
}
