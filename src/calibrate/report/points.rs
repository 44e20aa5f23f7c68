//! `points.csv`: every point that a calibration is based on.

use super::number::{exact, field};
use crate::board::{Lit, Sighting};
use crate::rig::Calibration;
use crate::solve::PointResidual;
use glam::{DMat2, DVec2};
use phasmid_geometry::Board;
use std::collections::BTreeMap;
use std::io::{Result, Write};

/// Column names. Residuals are observed minus predicted. They are empty for points that could not
/// be used; the projector's columns are empty for points without projector coordinates.
/// `camera_u_px` and `camera_v_px` are corrected for the bias of a dot's centroid. Each sigma is
/// the standard deviation of its residual's noise; as a projector coordinate is read at the
/// observed camera point, its residual and sigma include the camera point's error. The weight is 1
/// if all observations of the point are used, 0 if any of them is an outlier.
const HEAD: &str = "pose,column,row,board_x_mm,board_y_mm,camera_u_px,camera_v_px,\
camera_sigma_u_px,camera_sigma_v_px,projector_u_px,projector_v_px,projector_sigma_u_px,\
projector_sigma_v_px,camera_residual_u_px,camera_residual_v_px,projector_residual_u_px,\
projector_residual_v_px,weight";

/// Writes the points of all used poses.
pub(super) fn write(calibration: &Calibration, out: &mut impl Write) -> Result<()> {
    writeln!(out, "{HEAD}")?;
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

/// Covariance of an observed projector coordinate: its own noise and the effect of the camera
/// point's error.
fn observed(lit: &Lit, camera: DMat2) -> DMat2 {
    lit.slope * camera * lit.slope.transpose() + lit.covariance
}
