//! Rigid registration of measured points to a reference surface, in six degrees of freedom.
//!
//! Minimises, by Gauss-Newton on shift and rotation about the isocentre, a robust sum over points: the
//! squared distance of a point to the tangent plane at its foot (the closest point of the surface),
//! divided by the variance (Y. Chen and G. Medioni, "Object Modelling by Registration of Multiple Range
//! Images", 1992). Residuals are weighted by Tukey's biweight. Feet on a border of the surface or
//! outside the region are ignored, so skin measured beyond the region has no influence.
//!
//! Motions that the shape does not determine (see `modes`) keep their start values and are reported.
//!
//! Noise shifts points off a curved surface by a small bias that is the same in every scan: 2.5 um
//! for 0.5 mm of noise on a sphere of 100 mm radius. The mean bias follows from the surface's
//! curvature and each point's standard deviation, and is subtracted.
//!
//! | file | content |
//! | --- | --- |
//! | `rows` | one equation per measured point |
//! | `sums` | the normal equations |
//! | `modes` | which motions the shape determines |
//! | `step` | the settings, and one Gauss-Newton step |
//! | `search` | the search for start poses far from the planned one |
//! | `judge` | the tracked pose with its covariance and warnings |
//! | `freedom` | undetermined motions as shifts and turns |

mod freedom;
mod judge;
mod modes;
mod rows;
mod search;
mod step;
mod sums;
#[cfg(test)]
mod tests;

pub use freedom::Freedom;
pub(super) use freedom::shape;
pub use judge::RigidFit;
pub use search::Start;
pub use step::RigidOptions;

use super::measured::Measured;
use super::robust::Spread;
use super::surface::Reference;
use super::warning::{Lost, Warning};
use glam::DVec3;
use judge::{judged, lost};
use phasmid_geometry::Pose;
use rows::{Limits, update};
use search::{disagreement, starts};
use step::advance;

/// The residual scale is [wide](Spread::Wide) while steps are longer than this, in millimetres.
const COARSE_MM: f64 = 0.3;
/// A pose is reported as ambiguous if its disagreement is at most this factor times that of the best
/// pose.
const RIVAL: f64 = 1.15;
/// Poses closer than this, in millimetres, count as the same solution.
const SAME_MM: f64 = 2.0;

/// Finds the pose of the reference in the room from a scan.
///
/// # Errors
/// Returns an error if too few points lie over the region, or if they lie on a line.
pub fn track_rigid(
    measured: &Measured,
    reference: &Reference,
    start: &Start,
    options: &RigidOptions,
) -> Result<RigidFit, Lost> {
    let (around, range_mm) = match start {
        Start::Near(pose) => {
            return refine(measured, reference, *pose, options).map(|(fit, _)| fit);
        }
        Start::Within { around, range_mm } => (around, *range_mm),
    };
    let mut best: Option<(RigidFit, f64)> = None;
    let mut rivals = Vec::new();
    let mut lost = None;
    for pose in starts(measured, reference, options, around, range_mm) {
        match refine(measured, reference, pose, options) {
            Ok((fit, cost)) => {
                rivals.push((fit.room_from_reference, cost));
                if best.as_ref().is_none_or(|(_, least)| cost < *least) {
                    best = Some((fit, cost));
                }
            }
            Err(why) => lost = Some(why),
        }
    }
    let Some((mut fit, cost)) = best else {
        return Err(lost.unwrap_or(Lost::Points {
            found: 0,
            wanted: options.least_points,
        }));
    };
    // Poses that differ only along undetermined motions are one solution, already covered by a
    // warning.
    if fit.determined == 6 {
        let apart = rivals
            .iter()
            .filter(|(_, other)| *other <= RIVAL * cost)
            .map(|(pose, _)| apart_mm(pose, &fit.room_from_reference, reference))
            .fold(0.0, f64::max);
        if apart > SAME_MM {
            fit.warnings.push(Warning::Ambiguous { apart_mm: apart });
        }
    }
    Ok(fit)
}

/// RMS distance between the positions of a sample of the region's vertices under two poses.
fn apart_mm(a: &Pose, b: &Pose, reference: &Reference) -> f64 {
    let chosen: Vec<DVec3> = (0..reference.triangles().len() as u32)
        .filter(|&t| reference.is_inside(t))
        .step_by(37)
        .map(|t| reference.vertices()[reference.triangles()[t as usize][0] as usize])
        .collect();
    let squares = chosen
        .iter()
        .map(|&v| (a.point(v) - b.point(v)).length_squared());
    (squares.sum::<f64>() / chosen.len().max(1) as f64).sqrt()
}

/// Iterates to the nearest local solution. Returns the fit and its [`disagreement`].
fn refine(
    measured: &Measured,
    reference: &Reference,
    start: Pose,
    options: &RigidOptions,
) -> Result<(RigidFit, f64), Lost> {
    let mut least_free = 0;
    loop {
        let (fit, cost, moved) = descend(measured, reference, start, least_free, options)?;
        let free = 6 - fit.determined;
        if free <= moved {
            return Ok((fit, cost));
        }
        // The steps moved along motions that proved undetermined: repeat the descent without them.
        least_free = free;
    }
}

/// Runs one descent in which at least `least_free` modes keep their start values. Returns the fit,
/// its disagreement and the smallest number of modes held fixed in any step.
fn descend(
    measured: &Measured,
    reference: &Reference,
    start: Pose,
    least_free: usize,
    options: &RigidOptions,
) -> Result<(RigidFit, f64, usize), Lost> {
    let mut left_alone = 6;
    let limits = Limits {
        capture_mm: options.capture_mm,
        anywhere: false,
    };
    let pods = measured.eyes.len();
    let mut rows = Vec::new();
    let (mut pose, mut spread, mut afresh) = (start, Spread::Wide, true);
    let mut step_mm = f64::INFINITY;
    let mut iterations = 0;
    let some = measured.some();
    while iterations < options.max_iterations && step_mm > options.step_mm {
        let looked_at = match (&some, spread) {
            (Some(some), Spread::Wide) => some,
            _ => measured,
        };
        update(&mut rows, looked_at, reference, &pose, limits, afresh);
        let step = advance(&rows, pods, spread, least_free, reference, options)
            .ok_or_else(|| lost(&rows, options))?;
        left_alone = left_alone.min(step.free);
        pose = step.applied(&pose);
        iterations += 1;
        // The first search covers the whole surface; repeat it once the pose is nearly right.
        afresh = spread == Spread::Wide && step.size_mm <= COARSE_MM;
        step_mm = step.size_mm;
        if spread == Spread::Wide {
            if step.size_mm <= COARSE_MM || iterations >= options.max_iterations / 2 {
                spread = Spread::Narrow;
            }
            step_mm = f64::INFINITY;
        }
    }
    update(&mut rows, measured, reference, &pose, limits, false);
    let last = advance(&rows, pods, Spread::Narrow, least_free, reference, options)
        .ok_or_else(|| lost(&rows, options))?;
    if last.sums.count < options.least_points {
        return Err(lost(&rows, options));
    }
    let cost = disagreement(&rows);
    let mut fit = judged(&last, &rows, reference, &pose, options);
    fit.iterations = iterations;
    if step_mm > options.step_mm {
        fit.warnings.push(Warning::NotConverged {
            step_mm: last.size_mm,
        });
    }
    Ok((fit, cost, left_alone))
}
