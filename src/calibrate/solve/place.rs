//! Computes the pose of a board (six unknowns) for a known rig, by the same least squares as for a
//! whole rig.

use super::bundle::Bundle;
use super::homography::{FEWEST_POINTS, Homography};
use super::model::State;
use super::observation::PoseObservations;
use super::summary::solved_pose;
use super::{Choice, PoseSightings, SolvedPose, Unsolved, zhang};
use glam::DVec2;
use phasmid_geometry::parameters::RIG;
use phasmid_geometry::{Board, Lens, Pose, Rig};

/// Requirement on the image of a board, for error messages.
const WANTED: &str =
    "a flat board that the camera sees from its front, not flipped, and the projector lights";
/// Requirement on board and rig, for error messages.
const FITTING: &str = "a board of the specified size, in front of the calibrated rig";

/// Maximum RMS residual in pixels. A poor calibration causes one or two pixels; larger residuals
/// mean that the board or the rig is another one.
const MOST_RMS_PX: f64 = 3.0;

/// Pose of a board relative to a rig.
#[derive(Debug, Clone, PartialEq)]
pub struct Placed {
    /// Transforms board coordinates to the rig's frame, in millimetres.
    pub rig_from_board: Pose,
    /// Covariance of the board's rotation about its origin (radians, axes of the camera's frame),
    /// then of its origin's position (mm, in the camera's frame). It is inflated if the residuals
    /// exceed what the covariances of the points predict.
    pub covariance: [[f64; 6]; 6],
    /// The board's pose in the camera's frame and the residuals of its points. If its whitened RMS
    /// residual is above 1, the residuals exceed the noise, because the rig differs from its
    /// calibration.
    pub pose: SolvedPose,
}

/// Computes the pose of a board from its observed points and a known rig. Outliers are excluded.
///
/// # Errors
/// Returns an error if there are too few points, if they are collinear, if the board is mirrored,
/// or if no pose fits the points.
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
        found: "no pose that fits the points of camera and projector".to_owned(),
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
            found: format!("points {rms_px:.1} px (RMS) from their expected positions"),
            wanted: format!("{MOST_RMS_PX} px or less: {FITTING}"),
        });
    }
    // At most half of the points may be outliers.
    let counted = pose.camera_errors.count;
    if counted < FEWEST_POINTS || 2 * counted < sightings.sightings.len() {
        return Err(Unsolved::Unplaced {
            found: format!(
                "{counted} of {} points agree on the pose of the board",
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

/// Initial pose, from the homography of the points with the lens distortion removed.
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
        return Err(wrong("an image that shows the board mirrored".to_owned()));
    }
    let pinhole = Lens {
        distortion: [0.0; 5],
        ..*lens
    };
    zhang::pose(&pinhole, &map.matrix)
        .ok_or_else(|| wrong("points that no board in front of the camera can have".to_owned()))
}
