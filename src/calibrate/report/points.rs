//! `points.csv`: every point that a calibration rests on.

use super::number::{exact, field};
use crate::board::{Lit, Sighting};
use crate::rig::Calibration;
use crate::solve::PointResidual;
use glam::{DMat2, DVec2};
use phasmid_geometry::Board;
use std::collections::BTreeMap;
use std::io::{Result, Write};

/// Names of the columns. Residuals are seen minus expected; those of points that could not be used
/// are empty, and so is what belongs to the projector where it lit nothing. `camera_u_px` and
/// `camera_v_px` are the image of the point itself, freed of the bias of a dot's outline. Each sigma
/// is the standard deviation of its residual's noise: a projector coordinate is taken where the
/// camera saw the point, so that the camera point's error is in it, and in its sigma. The weight is 1
/// where all that is known of the point counts, and 0 where it or a part of it is an outlier.
const HEAD: &str = "pose,column,row,board_x_mm,board_y_mm,camera_u_px,camera_v_px,\
camera_sigma_u_px,camera_sigma_v_px,projector_u_px,projector_v_px,projector_sigma_u_px,\
projector_sigma_v_px,camera_residual_u_px,camera_residual_v_px,projector_residual_u_px,\
projector_residual_v_px,weight";

/// Writes the points of all poses that were used.
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
        residual.map(|r| r.camera_px),
        projector.map(|p| p.px),
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

/// Covariance of a projector coordinate as it was observed: what the camera point's error does to
/// it, and its own noise.
fn observed(lit: &Lit, camera: DMat2) -> DMat2 {
    lit.slope * camera * lit.slope.transpose() + lit.covariance
}
