//! Why the least squares comes to no end, by what it has seen on its way.

use super::Unsolved;
use super::check::LITTLE_TILT_DEG;
use super::model::State;
use super::observation::PoseObservations;
use super::start::{TILTS_WANTED, largest_angle_deg};
use glam::DVec3;

/// Standard deviations below this part of an image's width are finer than f64 resolves of a bundle:
/// a projection is rounded to some 1e-15 of it, and a last step that is 1e-4 standard deviations long
/// (see `fit`) sums over dozens of unknowns.
const FINEST: f64 = 1e-10;

/// What has stopped the least squares.
#[derive(Debug, Clone, Copy)]
pub(super) enum Why {
    /// The first guess has a point behind a lens, or is no number.
    NoStart,
    /// No more numbers than unknowns.
    TooFew { unknowns: usize },
    /// Some combination of the unknowns changes nothing that was seen.
    Open,
    /// Steps go on, the last one this long in squared standard deviations.
    Restless(f64),
}

/// The refusal of `observed` numbers of some poses, at the state where the search has stopped.
pub(super) fn refusal(
    why: Why,
    poses: &[PoseObservations],
    observed: usize,
    state: &State,
) -> Unsolved {
    let numbers = format!("{observed} numbers of {} poses", poses.len());
    let fewer = || format!("{TILTS_WANTED}, or fewer distortion coefficients");
    let found = match why {
        Why::NoStart => {
            return Unsolved::Undetermined {
                found: format!("{numbers} have no first guess with all points before both lenses"),
                wanted: "sightings of one rigid rig and one flat board".to_owned(),
            };
        }
        Why::TooFew { unknowns } => {
            return Unsolved::Undetermined {
                found: format!("{numbers} for {unknowns} unknowns"),
                wanted: "more points or poses, or fewer distortion coefficients".to_owned(),
            };
        }
        Why::Open => format!("{numbers} leave some of the unknowns open"),
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
                    "{numbers}: steps of the search stay {length:.0e} standard deviations long"
                ),
                false => format!("{numbers}: the search runs out of all numbers"),
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

/// The smallest standard deviation of a point along any direction, in pixels of its image.
fn finest_px(poses: &[PoseObservations]) -> f64 {
    let whiteners = poses.iter().flat_map(|p| &p.points).flat_map(|o| {
        let lit = o.lit.as_ref().map(|lit| lit.whitener);
        std::iter::once(o.camera_whitener).chain(lit)
    });
    // A whitener's longest image of a unit vector is at most its Frobenius norm, and no less than
    // that over the root of two.
    let norm = |w: glam::DMat2| w.x_axis.length_squared() + w.y_axis.length_squared();
    whiteners
        .map(|w| 1.0 / norm(w).sqrt())
        .fold(f64::INFINITY, f64::min)
}
