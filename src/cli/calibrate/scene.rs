//! The scene of a calibration: a board and nothing else.

use phasmid_core::error::Result;
use phasmid_geometry::{Board, Pose};
use phasmid_profile::Scene;

/// Reflectance of the paper. The exposure of the built-in devices is set so that a white wall at 1 m
/// fills three quarters of the full well, and a board comes as near as 700 mm.
const PAPER: f64 = 0.45;
/// Ambient irradiance in W/m^2, as in the built-in scenes.
const AMBIENT_W_M2: f64 = 0.02;

/// Returns the scene with a board in a pose.
///
/// # Errors
/// Returns an error if the board or the pose is not one of a scene.
pub(super) fn scene(board: &Board, rig_from_board: &Pose) -> Result<Scene> {
    Scene::parse(&text(board, rig_from_board), "board")
}

fn text(board: &Board, rig_from_board: &Pose) -> String {
    let (position, rotation) = rig_from_board.to_xyz_deg();
    let board = toml::Value::try_from(board).expect("numbers and words");
    format!(
        "name = \"board\"\ndescription = \"A calibration board\"\n\n\
         [ambient]\nirradiance_w_m2 = {AMBIENT_W_M2}\n\n\
         [[object]]\nposition_mm = {:?}\nrotation_deg = {:?}\nalbedo = {PAPER}\n\
         shape = {{ kind = \"board\", board = {board} }}\n",
        position, rotation
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn scene_holds_board_and_pose() {
        let at = Pose::from_xyz_deg(DVec3::new(1.5, -2e-7, 1000.0), DVec3::new(20.0, -31.5, 7.0));
        for board in [Board::DOTS.scaled(4.0), Board::CHESS] {
            let scene = scene(&board, &at).unwrap();
            assert_eq!(scene.object.len(), 1);
            let placed = scene.rig_from_object(&scene.object[0]);
            let off = (placed.rotation - at.rotation).to_cols_array();
            assert!(off.iter().all(|o| o.abs() < 1e-14));
            assert_eq!(placed.translation_mm, at.translation_mm);
        }
    }
}
