//! Shows calibration boards to an emulated device in this process, and returns the data that a
//! calibration keeps of each board.

use super::scanned::Stage;
use phasmid_calibrate::board::{BoardImage, NotFound};
use phasmid_calibrate::rig::{PoseData, sight};
use phasmid_core::error::{Error, Result};
use phasmid_decode::{Capture, Options};
use phasmid_geometry::{Board, Pose};
use phasmid_profile::{Profile, Scene, Shape};
use phasmid_render as render;

/// Reflectance of the board's paper and ink, as in `phasmid calibrate`.
const PAPER: f64 = 0.45;
const INK: f64 = 0.06;

/// Shows a board in one pose to a device whose first sequence encodes both axes. Returns the data that
/// a calibration keeps, or the reason why the board was not found.
///
/// # Errors
/// Returns an error if the profile cannot be rendered or its sequence cannot be decoded.
pub fn shown_to(
    profile: &Profile,
    board: &Board,
    rig_from_board: &Pose,
    name: &str,
    seed: u64,
) -> Result<Result<PoseData, NotFound>> {
    let mut scene = Scene::load("board")?;
    for object in &mut scene.object {
        object.shape = Shape::Board {
            board: *board,
            ink: INK,
        };
        object.albedo = PAPER;
    }
    let (position, rotation) = rig_from_board.to_xyz_deg();
    scene.place(0, position, rotation)?;
    seen_in(&scene, profile, board, name, seed)
}

/// Like [`shown_to`], for a board in a scene.
///
/// # Errors
/// Returns the errors of [`shown_to`].
pub fn seen_in(
    scene: &Scene,
    profile: &Profile,
    board: &Board,
    name: &str,
    seed: u64,
) -> Result<Result<PoseData, NotFound>> {
    let scanned = Stage::new(profile, scene, seed, render::Options::default())?.scan(0)?;
    let noise = profile.nominal_rig().noise;
    let noise = noise.ok_or_else(|| Error::device("a rig without noise"))?;
    let options = Options {
        noise: Some(noise),
        ..Options::default()
    };
    // Remove the rig, because no points are triangulated here.
    let uncalibrated = Capture {
        calibration: None,
        ..scanned
    };
    let (_, decoded) = uncalibrated.decode(options)?;
    let picture = BoardImage::from_frames(&uncalibrated.manifest, &uncalibrated.images, &noise)?;
    Ok(sight(board, name, &picture, &decoded))
}
