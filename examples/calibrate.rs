//! Calibrates an emulated device like a physical device, from scans of a board in several poses,
//! and compares the result with the true rig.
//!
//! ```sh
//! cargo run --release --example calibrate
//! ```

use phasmid::calibrate::solve::Choice;
use phasmid::geometry::Board;
use phasmid::geometry::board_poses::{Wanted, poses};
use phasmid::profile::{Profile, Scene, Shape};
use phasmid::{Device, Error};

fn main() -> Result<(), Error> {
    let profile = Profile::load("pmp-bench")?;
    let board = Board::DOTS.scaled(profile.calibration.board_scale.unwrap_or(1.0));
    // The scene contains only a board; each scan moves the board to another pose.
    let mut scene = Scene::load("board")?;
    scene.object[0].shape = Shape::Board { board, ink: 0.06 };
    scene.object[0].albedo = 0.45;
    let sequence = profile.calibration_sequence().expect("both axes");
    let mut device = Device::builder()
        .profile(profile.clone())
        .scene(scene)
        .build()?;
    let wanted = Wanted {
        count: 8,
        distance_mm: profile.calibration.distance_mm,
        ..Wanted::default()
    };
    let mut captures = Vec::new();
    for rig_from_board in poses(&board, &device.rig(), &wanted)? {
        let (position_mm, rotation_deg) = rig_from_board.to_xyz_deg();
        device.place(0, position_mm, rotation_deg)?;
        captures.push(device.scan(&sequence.name)?);
    }
    let calibration = phasmid::calibrate(&captures, &board, Choice::default())?;
    let solution = &calibration.solution;
    let (squared, parameters) = solution.mahalanobis(&device.rig(), None);
    println!(
        "{} poses, {:.3} px RMS; off the truth by {squared:.1} over {parameters} parameters \
         (squared Mahalanobis distance)",
        solution.poses.len(),
        solution.camera_errors.rms_px
    );
    assert!(
        squared < 4.0 * parameters as f64,
        "the covariance does not explain the error"
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    #[test]
    fn runs() {
        super::main().unwrap();
    }
}
