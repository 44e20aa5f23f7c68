//! Where a board stands before a rig that is known: six unknowns, by the same least squares as all of
//! a rig's.

use super::bundle::Bundle;
use super::homography::Homography;
use super::model::{RIG, State};
use super::observation::PoseObservations;
use super::start::FEWEST_POINTS;
use super::summary::solved_pose;
use super::{Choice, PoseSightings, SolvedPose, Unsolved, zhang};
use glam::DVec2;
use phasmid_geometry::{Board, Lens, Pose, Rig};

/// What is wanted of a picture of one board.
const WANTED: &str =
    "a flat board that the camera sees from its front, not flipped, and the projector lights";
/// What is wanted of a board and a rig.
const FITTING: &str = "a board of the size that was said, before the rig that was calibrated";

/// Points that leave more than so many pixels (RMS) are those of another board or another rig: the worst
/// of calibrations leave one or two.
const MOST_RMS_PX: f64 = 3.0;

/// A board's place before a rig.
#[derive(Debug, Clone, PartialEq)]
pub struct Placed {
    /// Takes coordinates on the board to the rig's frame, in millimetres.
    pub rig_from_board: Pose,
    /// Covariance of the board's turn about the camera's axes through its origin (radians) and of its
    /// origin's place (mm, the camera's frame), residuals that are larger than they should be counted
    /// in.
    pub covariance: [[f64; 6]; 6],
    /// The board before the camera, and what each of its points leaves: more than 1 whitened is more
    /// than noise, so that the rig is not what it is taken for.
    pub pose: SolvedPose,
}

/// Places a board by its points before a camera and a projector that are known. Points that do not fit
/// the rest are left out.
///
/// # Errors
/// Fewer points than it takes, points on a line, a mirrored board, and points that fit no place.
pub fn place(board: &Board, sightings: &PoseSightings, rig: &Rig) -> Result<Placed, Unsolved> {
    let mut bundle = Bundle::new(board, std::slice::from_ref(sightings));
    let choice = Choice::default();
    let mut state = State {
        camera: rig.camera.lens,
        projector: rig.projector.lens,
        rig_from_projector: rig.camera.rig_from_view.inverse() * rig.projector.rig_from_view,
        boards: vec![start(&bundle.poses[0], &rig.camera.lens)?],
    };
    let free = [false; RIG];
    let no_place = |_| Unsolved::Unplaced {
        found: "no place that fits what camera and projector have seen".to_owned(),
        wanted: FITTING.to_owned(),
    };
    bundle
        .approach(&mut state, &free, &choice, false)
        .map_err(no_place)?;
    let settled = bundle.settle(state, &free, &choice).map_err(no_place)?;
    let pose = solved_pose(&bundle.poses[0], &settled.state, 0);
    let rms_px = pose.camera_errors.rms_px.max(pose.projector_errors.rms_px);
    if !(rms_px <= MOST_RMS_PX) {
        return Err(Unsolved::Unplaced {
            found: format!("points {rms_px:.1} px (RMS) from where the board would have them"),
            wanted: format!("{MOST_RMS_PX} px or less: {FITTING}"),
        });
    }
    // Half of them cannot be exceptions.
    let counted = pose.camera_errors.count;
    if counted < FEWEST_POINTS || 2 * counted < sightings.sightings.len() {
        return Err(Unsolved::Unplaced {
            found: format!(
                "{counted} of {} points agree on where the board is",
                sightings.sightings.len()
            ),
            wanted: WANTED.to_owned(),
        });
    }
    Ok(Placed {
        rig_from_board: rig.camera.rig_from_view * pose.camera_from_board,
        covariance: std::array::from_fn(|i| std::array::from_fn(|j| settled.covariance[(i, j)])),
        pose,
    })
}

/// By the homography of points as a lens without distortion would show them.
fn start(pose: &PoseObservations, lens: &Lens) -> Result<Pose, Unsolved> {
    let ideal = |px: DVec2| lens.ray(px).truncate() * lens.focal_px + lens.principal_px;
    let pairs = pose.points.iter().map(|o| (o.board, ideal(o.camera)));
    let pairs: Vec<_> = pairs.filter(|(_, px)| px.is_finite()).collect();
    let wrong = |found: String| Unsolved::Unplaced {
        found,
        wanted: WANTED.to_owned(),
    };
    if pairs.len() < FEWEST_POINTS {
        return Err(wrong(format!("{} points", pairs.len())));
    }
    let map = Homography::fit(&pairs, true)
        .ok_or_else(|| wrong(format!("{} points on a line", pairs.len())))?;
    if !map.keeps_sense() {
        return Err(wrong("a picture that shows the board mirrored".to_owned()));
    }
    let pinhole = Lens {
        distortion: [0.0; 5],
        ..*lens
    };
    zhang::pose(&pinhole, &map.matrix)
        .ok_or_else(|| wrong("points that no board before the camera has".to_owned()))
}
