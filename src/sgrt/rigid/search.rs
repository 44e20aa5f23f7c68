//! Global search: many start poses tried with few points, of which the best are refined.

use super::super::measured::Measured;
use super::super::robust::Spread;
use super::super::surface::Reference;
use super::RigidOptions;
use super::rows::{Limits, Row, update};
use super::step::advance;
use glam::DVec3;
use phasmid_geometry::Pose;
use phasmid_geometry::rotation::exp;

/// Number of points in a trial.
const POINTS: usize = 800;
/// Number of steps in a trial.
const STEPS: usize = 16;
/// Distance scale of [`disagreement`], in millimetres: points closer to the surface agree with a
/// pose.
const AGREE_MM: f64 = 4.0;
/// Number of trials that are refined.
const KEPT: usize = 3;

/// Where to search for a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Start {
    /// Search near this `room_from_reference`, for example the result of the previous scan.
    Near(Pose),
    /// Search up to `range_mm` from `around` along each axis, and at rotations of up to about 15
    /// degrees.
    Within {
        /// The `room_from_reference` at the centre of the search.
        around: Pose,
        /// Search range along each axis, in millimetres.
        range_mm: f64,
    },
}

/// Finds poses worth refining, best first. Trials use the whole surface instead of the region alone,
/// because the surroundings also constrain the pose.
pub(super) fn starts(
    measured: &Measured,
    reference: &Reference,
    options: &RigidOptions,
    around: &Pose,
    range_mm: f64,
) -> Vec<Pose> {
    let few = measured.thinned(POINTS);
    let limits = Limits {
        capture_mm: options.capture_mm.max(2.0 * range_mm),
        anywhere: true,
    };
    let mut trials: Vec<(f64, Pose)> = offsets(range_mm)
        .into_iter()
        .map(|(shift, tilt)| {
            let mut pose = Pose {
                rotation: exp(tilt) * around.rotation,
                translation_mm: around.translation_mm + shift,
            };
            let mut rows = Vec::new();
            for step in 0..STEPS {
                update(&mut rows, &few, reference, &pose, limits, step % 4 == 0);
                let spread = if step < 3 * STEPS / 4 {
                    Spread::Wide
                } else {
                    Spread::Narrow
                };
                match advance(&rows, few.eyes.len(), spread, 0, reference, options) {
                    Some(step) => pose = step.applied(&pose),
                    None => break,
                }
            }
            update(&mut rows, &few, reference, &pose, limits, true);
            (disagreement(&rows), pose)
        })
        .collect();
    trials.sort_by(|a, b| a.0.total_cmp(&b.0));
    trials.truncate(KEPT);
    trials.into_iter().map(|(_, pose)| pose).collect()
}

/// Mean over all points of the squared distance in units of [`AGREE_MM`], limited to 1; a point
/// without a valid foot counts as 1.
pub(super) fn disagreement(rows: &[Row]) -> f64 {
    let cost = |row: &Row| {
        if row.counts() {
            (row.distance_mm / AGREE_MM).powi(2).min(1.0)
        } else {
            1.0
        }
    };
    rows.iter().map(cost).sum::<f64>() / rows.len().max(1) as f64
}

/// Start offsets (shift in mm, rotation vector in rad): the centre, shifts of two thirds of the range
/// along each axis and to the corners, and rotations either way about each axis.
fn offsets(range_mm: f64) -> Vec<(DVec3, DVec3)> {
    let out = range_mm * 2.0 / 3.0;
    let mut found = vec![(DVec3::ZERO, DVec3::ZERO)];
    for axis in DVec3::AXES {
        for side in [-1.0, 1.0] {
            found.push((axis * side * out, DVec3::ZERO));
            found.push((DVec3::ZERO, axis * side * 0.14));
        }
    }
    for corner in 0..8 {
        let side = |bit: u32| if corner >> bit & 1 == 1 { out } else { -out };
        found.push((DVec3::new(side(0), side(1), side(2)), DVec3::ZERO));
    }
    found
}
