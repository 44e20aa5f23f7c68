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
//! - The inverse of the normal matrix is the covariance. If residuals exceed the given covariances
//!   of the points, these covariances are inflated before.
//!
//! | Files | Contents |
//! | --- | --- |
//! | `homography`, `zhang`, `resection` | closed-form estimates |
//! | `start` | initial state; exclusion of unusable poses |
//! | `observation`, `model` | whitened observations, predictions, derivatives |
//! | `normal`, `fit`, `robust` | normal equations, Levenberg-Marquardt, robust loss and outliers |
//! | `coefficients` | choice of distortion model |
//! | `bundle` | the stages of bundle adjustment; exclusion of inconsistent poses |
//! | `place` | pose of one board for a known rig |
//! | `solution`, `summary`, `check` | the result, its assembly, and warnings |
//! | `unfit` | reasons why a pose is excluded |
//! | `unsolved`, `refusal` | the error type and its diagnosis |
//! | `chi_square` | the chi-square distribution |

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
mod summary;
#[cfg(test)]
mod tests;
mod unfit;
mod unsolved;
mod zhang;

pub use chi_square::{chi_square_below, chi_square_bound};
pub use coefficients::{Choice, Coefficients};
pub use observation::PoseSightings;
pub use place::{Placed, place};
pub use solution::{
    Errors, LeftOut, Parameter, PointResidual, ProjectorResidual, Solution, SolvedPose,
};
pub use unfit::Unfit;
pub use unsolved::Unsolved;

use bundle::{Bundle, Solved, unfolded};
use coefficients::{Model, free, ranked, restricted};
use phasmid_core::Stop;
use phasmid_geometry::Board;
use phasmid_geometry::board_poses::MOST_POSES;

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

/// Like [`solve`], but another thread can end the call early.
///
/// # Errors
/// Returns [`Unsolved::Interrupted`] soon after a stop is requested, and the errors of [`solve`].
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
    let mut bundle = Bundle::new(board, poses);
    bundle.stop = stop.clone();
    let solved = bundle.solve([camera_px, projector_px], choice)?;
    let mut solution = summary::of(bundle, solved);
    check::refuse(&solution)?;
    solution.warnings = check::warnings(&solution, poses, choice);
    Ok(solution)
}

impl Bundle {
    /// Solves from the closed-form start to the minimum.
    fn solve(&mut self, sizes: [[u32; 2]; 2], choice: &Choice) -> Result<Solved, Unsolved> {
        let wanted = [choice.camera, choice.projector];
        let radial = [true, true, false, false, false];
        let most: Model = wanted.map(Coefficients::most);
        let first: Model = most.map(|set| std::array::from_fn(|i| set[i] && radial[i]));
        let fewer: Model = std::array::from_fn(|i| match wanted[i] {
            Coefficients::Auto => [true, true, true, true, false],
            Coefficients::Fixed(set) => set,
        });
        let least: Model = wanted.map(Coefficients::least);

        let maps = start::maps(self, choice.robust)?;
        let mut state = start::state(self, &maps, sizes, &first, choice)?;
        self.drop_behind(&mut state)?;
        self.approach(&mut state, &free(&first), choice, false)?;
        let mut solved = self.largest(&state, &[most, fewer, first, least], choice)?;
        let largest = solved.model;
        let order = ranked(
            wanted,
            &largest,
            &solved.state,
            &solved.covariance,
            self.observed(),
        );
        for model in order {
            if model == largest {
                break;
            }
            let mut other = self.clone();
            let smaller = restricted(&solved.state, &model);
            match other.settle(smaller, &free(&model), choice) {
                Ok(found) if unfolded(&found.state, &model, choice) => {
                    (*self, solved) = (other, found.of(model));
                    break;
                }
                Err(Unsolved::Interrupted) => return Err(Unsolved::Interrupted),
                _ => {}
            }
        }
        Ok(solved)
    }
}
