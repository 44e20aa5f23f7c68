//! `poses.csv`: the pose of each board and how well it fits.

use super::about::About;
use super::number::{exact, field};
use crate::rig::Calibration;
use crate::solve::Errors;
use glam::{DQuat, DVec3};
use phasmid_geometry::Pose;
use std::io::{Result, Write};

const HEAD: &str = "pose,x_mm,y_mm,z_mm,turn_x_rad,turn_y_rad,turn_z_rad,tilt_deg,camera_points,\
camera_mean_px,camera_rms_px,camera_max_px,camera_whitened_rms,projector_points,\
projector_mean_px,projector_rms_px,projector_max_px,projector_whitened_rms,picture";

/// Writes the used poses: the board's origin and rotation vector in the camera's frame, the angle
/// between its normal and the line of sight to its origin, residual statistics, and the image file.
pub(super) fn write(calibration: &Calibration, about: &About, out: &mut impl Write) -> Result<()> {
    writeln!(out, "{HEAD}")?;
    for pose in &calibration.solution.poses {
        let board = &pose.camera_from_board;
        let turn = turn(board);
        let mut fields = vec![field(&pose.name).into_owned()];
        fields.extend(board.translation_mm.to_array().map(exact));
        fields.extend(turn.to_array().map(exact));
        fields.push(exact(pose.tilt_deg()));
        fields.extend(errors(&pose.camera_errors));
        fields.extend(errors(&pose.projector_errors));
        let image = about.image(&pose.name).unwrap_or("");
        fields.push(field(image).into_owned());
        writeln!(out, "{}", fields.join(","))?;
    }
    Ok(())
}

fn errors(e: &Errors) -> [String; 5] {
    [
        e.count.to_string(),
        exact(e.mean_px),
        exact(e.rms_px),
        exact(e.max_px),
        exact(e.whitened_rms),
    ]
}

/// Rotation vector of a pose, in radians.
fn turn(pose: &Pose) -> DVec3 {
    DQuat::from_mat3(&pose.rotation).to_scaled_axis()
}
