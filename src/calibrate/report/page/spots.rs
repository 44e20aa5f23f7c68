//! The points of all used poses in both images, with their residuals.

use crate::board::Sighting;
use crate::rig::Calibration;
use crate::solve::PointResidual;
use glam::DVec2;
use std::collections::BTreeMap;

/// A point in one of the two images.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Spot {
    /// Observed camera point or decoded projector coordinate, in pixels.
    pub at: DVec2,
    /// Observed minus predicted, in pixels.
    pub residual: DVec2,
    /// Residual whitened with its covariance.
    pub whitened: DVec2,
    /// Whether the point is used; false for an outlier.
    pub counts: bool,
    /// Pose, column and row of the point, for display.
    pub name: String,
}

/// Points in the camera's image.
pub(super) fn camera(calibration: &Calibration) -> Vec<Spot> {
    gather(calibration, |sighting, point| {
        Some((
            sighting.camera_px,
            point.camera_px.into(),
            point.camera_whitened.into(),
            point.camera_weight,
        ))
    })
}

/// Points in the projector's image.
pub(super) fn projector(calibration: &Calibration) -> Vec<Spot> {
    gather(calibration, |sighting, point| {
        let (lit, fit) = (sighting.projector?, point.projector?);
        let (px, whitened) = (fit.px.into(), fit.whitened.into());
        Some((lit.px, px, whitened, fit.weight))
    })
}

fn gather(
    calibration: &Calibration,
    of: impl Fn(&Sighting, &PointResidual) -> Option<(DVec2, DVec2, DVec2, f64)>,
) -> Vec<Spot> {
    let mut spots = Vec::new();
    for pose in &calibration.solution.poses {
        let Some(given) = calibration.sightings.get(pose.given) else {
            continue;
        };
        let seen: BTreeMap<[u32; 2], &Sighting> =
            given.sightings.iter().map(|s| (s.index, s)).collect();
        for point in &pose.points {
            let found = seen.get(&point.index).and_then(|s| of(s, point));
            if let Some((at, residual, whitened, weight)) = found {
                let [column, row] = point.index;
                spots.push(Spot {
                    at,
                    residual,
                    whitened,
                    counts: weight > 0.0,
                    name: format!("{}, column {column}, row {row}", pose.name),
                });
            }
        }
    }
    spots
}
