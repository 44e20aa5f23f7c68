//! Diagnoses why bundle adjustment did not converge, among other things from the angles between boards.

use super::Unsolved;
use super::model::State;
use super::observation::PoseObservations;
use glam::DVec3;

/// Minimum standard deviation of a point, as a fraction of the image's width, with which a bundle
/// adjustment in f64 can converge. A projection is rounded to about 1e-15 of the width, and the
/// last step of 1e-4 standard deviations (see `fit`) is a sum over dozens of unknowns.
const FINEST: f64 = 1e-10;

/// If the largest angle between two boards is below this, a warning is issued.
pub(super) const LITTLE_TILT_DEG: f64 = 15.0;
/// Recommended board poses, for error messages.
pub(super) const TILTS_WANTED: &str =
    "boards tilted in different directions, by 15 degrees or more between two of them";

/// Reason why the minimisation failed.
#[derive(Debug, Clone, Copy)]
pub(super) enum Why {
    /// The initial state is not finite or puts a point behind a lens.
    NoStart,
    /// There are no more scalar observations than unknowns.
    TooFew { unknowns: usize },
    /// Some combination of the unknowns does not affect the observations.
    Open,
    /// The caller ended the call early.
    Stopped,
    /// Steps do not become small; holds the last step's squared length in standard deviations.
    Restless(f64),
}

/// Builds the error from the reason, the poses with `observed` scalar observations, and the last
/// state.
pub(super) fn refusal(
    why: Why,
    poses: &[PoseObservations],
    observed: usize,
    state: &State,
) -> Unsolved {
    let numbers = format!("{observed} numbers of {} poses", poses.len());
    let fewer = || format!("{TILTS_WANTED}, or fewer distortion coefficients");
    let found = match why {
        Why::Stopped => return Unsolved::Interrupted,
        Why::NoStart => {
            return Unsolved::Undetermined {
                found: format!(
                    "{numbers} have no first guess with all points in front of both lenses"
                ),
                wanted: "sightings of one rigid rig and one flat board".to_owned(),
            };
        }
        Why::TooFew { unknowns } => {
            return Unsolved::Undetermined {
                found: format!("{numbers} for {unknowns} unknowns"),
                wanted: "more points or poses, or fewer distortion coefficients".to_owned(),
            };
        }
        Why::Open => format!("{numbers} leave some of the unknowns undetermined"),
        Why::Restless(square) => {
            let length = square.sqrt();
            let finest = finest_px(poses);
            let width = f64::from(state.camera.width_px.max(state.projector.width_px));
            if finest < FINEST * width {
                return Unsolved::Undetermined {
                    found: format!(
                        "points are said to be known to {finest:.0e} px, finer than rounding: the \
                         search does not come to rest"
                    ),
                    wanted: format!("standard deviations of {:.0e} px or more", FINEST * width),
                };
            }
            match length.is_finite() {
                true => format!(
                    "{numbers}: the solver's steps stay {length:.0e} standard deviations long"
                ),
                false => format!("{numbers}: the solver diverged"),
            }
        }
    };
    let normals: Vec<DVec3> = state.boards.iter().map(|b| b.rotation.z_axis).collect();
    let angle = largest_angle_deg(&normals);
    if angle < LITTLE_TILT_DEG {
        return Unsolved::Parallel {
            found: format!(
                "where the search has stopped, the largest angle between two boards is {angle:.1} \
                 degrees; {found}"
            ),
            wanted: TILTS_WANTED.to_owned(),
        };
    }
    Unsolved::Undetermined {
        found,
        wanted: fewer(),
    }
}

/// Largest angle between the normals of any two boards, in degrees.
pub(super) fn largest_angle_deg(normals: &[DVec3]) -> f64 {
    let mut largest = 0.0f64;
    for (i, a) in normals.iter().enumerate() {
        for b in &normals[..i] {
            largest = largest.max(a.cross(*b).length().atan2(a.dot(*b)).to_degrees());
        }
    }
    largest
}

/// Smallest standard deviation of any point along any direction, in pixels of its image (up to a
/// factor of sqrt(2)).
fn finest_px(poses: &[PoseObservations]) -> f64 {
    let whiteners = poses.iter().flat_map(|p| &p.points).flat_map(|o| {
        let lit = o.lit.as_ref().map(|lit| lit.whitener);
        std::iter::once(o.camera_whitener).chain(lit)
    });
    // The Frobenius norm of a 2 x 2 whitener is between 1 and sqrt(2) times its spectral norm.
    let norm = |w: glam::DMat2| w.x_axis.length_squared() + w.y_axis.length_squared();
    whiteners
        .map(|w| 1.0 / norm(w).sqrt())
        .fold(f64::INFINITY, f64::min)
}
