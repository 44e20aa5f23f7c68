//! `poses.csv`: the pose of each board and how well it fits; `points.csv`: every point that a
//! calibration is based on.

use super::about::About;
use super::number::{exact, field};
use crate::board::{Lit, Sighting};
use crate::rig::Calibration;
use crate::solve::{Errors, PointResidual};
use glam::{DMat2, DQuat, DVec2, DVec3};
use phasmid_geometry::{Board, Pose};
use std::collections::BTreeMap;
use std::io::{Result, Write};

const POSES_HEAD: &str = "pose,x_mm,y_mm,z_mm,turn_x_rad,turn_y_rad,turn_z_rad,tilt_deg,camera_points,\
camera_mean_px,camera_rms_px,camera_max_px,camera_whitened_rms,projector_points,\
projector_mean_px,projector_rms_px,projector_max_px,projector_whitened_rms,picture";

/// Writes the used poses: the board's origin and rotation vector in the camera's frame, the angle
/// between its normal and the line of sight to its origin, residual statistics, and the image file.
pub(super) fn write_poses(
    calibration: &Calibration,
    about: &About,
    out: &mut impl Write,
) -> Result<()> {
    writeln!(out, "{POSES_HEAD}")?;
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

/// Column names. Residuals are observed minus predicted. They are empty for points that could not
/// be used; the projector's columns are empty for points without projector coordinates.
/// `camera_u_px` and `camera_v_px` are corrected for the bias of a dot's centroid. Each sigma is
/// the standard deviation of its residual's noise; as a projector coordinate is read at the
/// observed camera point, its residual and sigma include the camera point's error. The weight is 1
/// if all observations of the point are used, 0 if any of them is an outlier.
const POINTS_HEAD: &str = "pose,column,row,board_x_mm,board_y_mm,camera_u_px,camera_v_px,\
camera_sigma_u_px,camera_sigma_v_px,projector_u_px,projector_v_px,projector_sigma_u_px,\
projector_sigma_v_px,camera_residual_u_px,camera_residual_v_px,projector_residual_u_px,\
projector_residual_v_px,weight";

/// Writes the points of all used poses.
pub(super) fn write_points(calibration: &Calibration, out: &mut impl Write) -> Result<()> {
    writeln!(out, "{POINTS_HEAD}")?;
    for pose in &calibration.solution.poses {
        let Some(given) = calibration.sightings.get(pose.given) else {
            continue;
        };
        let residuals: BTreeMap<[u32; 2], &PointResidual> =
            pose.points.iter().map(|p| (p.index, p)).collect();
        let name = field(&pose.name);
        for sighting in &given.sightings {
            let residual = residuals.get(&sighting.index).copied();
            writeln!(
                out,
                "{name},{}",
                row(&calibration.board, sighting, residual)
            )?;
        }
    }
    Ok(())
}

fn row(board: &Board, sighting: &Sighting, residual: Option<&PointResidual>) -> String {
    let [column, row] = sighting.index;
    let sigma = |c: DMat2| DVec2::new(c.x_axis.x.sqrt(), c.y_axis.y.sqrt());
    let lit = sighting.projector;
    let projector = residual.and_then(|r| r.projector);
    let pairs = [
        Some(board.point(sighting.index)),
        Some(sighting.camera_px),
        Some(sigma(sighting.camera_covariance)),
        lit.map(|l| l.px),
        lit.map(|l| sigma(observed(&l, sighting.camera_covariance))),
        residual.map(|r| r.camera_px.into()),
        projector.map(|p| p.px.into()),
    ];
    let mut fields = vec![column.to_string(), row.to_string()];
    for pair in pairs {
        let pair = pair.unwrap_or(DVec2::NAN);
        fields.extend([exact(pair.x), exact(pair.y)]);
    }
    let both = |r: &PointResidual| r.camera_weight.min(r.projector.map_or(1.0, |p| p.weight));
    fields.push(exact(residual.map_or(0.0, both)));
    fields.join(",")
}

/// Covariance of an observed projector coordinate: the noise of the coordinate itself, plus the
/// error that it inherits from the camera point.
fn observed(lit: &Lit, camera: DMat2) -> DMat2 {
    lit.slope * camera * lit.slope.transpose() + lit.covariance
}
