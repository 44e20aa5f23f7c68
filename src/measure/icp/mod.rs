//! Registration of a cloud onto a surface: point-to-plane iterative closest points (Y. Chen and G.
//! Medioni, "Object Modelling by Registration of Multiple Range Images", 1992), with outlier
//! rejection; degrees of freedom that the shape does not determine are left unchanged.
//!
//! Each step minimises ((x + w x (x - c) + t - q) . n)^2, summed over points x with closest point q
//! and normal n. With rotations about the centroid c, and lengths in units of the RMS spread of the
//! points about it, the six unknowns have the same scale, and an eigenvalue of the 6 x 6 system
//! says how well its direction is determined: a plane leaves three directions free, a sphere three,
//! a cylinder two. The step does not move along free directions.

mod pairs;
mod step;
#[cfg(test)]
mod tests;

use super::metrics::finite_points;
use super::surface::Surface;
use glam::DVec3;
use pairs::{Clip, pairs};
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{Cloud, Pose};
use serde::Serialize;
use step::{Step, orthonormal};

/// Registration parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IcpOptions {
    /// Maximum number of steps.
    pub max_iterations: usize,
    /// Maximum number of points used, taken evenly along the cloud.
    pub max_points: usize,
    /// Converged when a step moves the points by at most this fraction of the cloud's spread.
    pub tolerance: f64,
    /// Directions whose eigenvalue is below this fraction of the largest are treated as free: 1e-5
    /// corresponds to a slope of 0.3 % RMS.
    pub free_below: f64,
}

impl Default for IcpOptions {
    fn default() -> Self {
        Self {
            max_iterations: 100,
            max_points: 20_000,
            tolerance: 1e-10,
            free_below: 1e-5,
        }
    }
}

/// Result of a registration.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Alignment {
    /// Maps coordinates in the cloud's frame to the truth's frame, in millimetres.
    pub truth_from_cloud: Pose,
    /// Number of steps.
    pub iterations: usize,
    /// Whether the last step was below the tolerance.
    pub converged: bool,
    /// Number of the six degrees of freedom that the shape determines.
    pub determined: usize,
    /// Largest over smallest singular value of the system in the determined directions.
    pub condition: f64,
    /// Number of points used in the last step.
    pub points: usize,
    /// RMS distance in millimetres to the tangent planes, over the points used in the first step.
    pub rms_before_mm: f64,
    /// The same for the last step.
    pub rms_after_mm: f64,
}

/// Finds the rigid motion that aligns a cloud with a nearby surface, both in millimetres.
///
/// # Errors
/// Returns an error if the cloud has no finite point, or if no point lies over the surface.
pub fn align(cloud: &Cloud, surface: &Surface, options: &IcpOptions) -> Result<Alignment> {
    let all = finite_points(cloud)?;
    let stride = all.len().div_ceil(options.max_points.max(1));
    let points: Vec<DVec3> = all.iter().copied().step_by(stride).collect();
    let mut pose = Pose::IDENTITY;
    let mut clip = Clip::Wide;
    let mut result: Option<Alignment> = None;
    for iteration in 1..=options.max_iterations {
        let moved: Vec<DVec3> = points.iter().map(|&p| pose.point(p)).collect();
        let pairs = clip.keep(pairs(&moved, &surface.closest_batch(&moved)));
        let Some(step) = Step::solve(&pairs, options.free_below) else {
            break;
        };
        pose = step.motion() * pose;
        // Re-orthonormalise: products of many rotations drift.
        pose.rotation = orthonormal(pose.rotation);
        let done = step.size() <= options.tolerance * step.spread;
        result = Some(Alignment {
            truth_from_cloud: pose,
            iterations: iteration,
            converged: done && clip == Clip::Narrow,
            determined: step.determined,
            condition: step.condition,
            points: pairs.len(),
            rms_before_mm: result.map_or(step.rms, |r| r.rms_before_mm),
            rms_after_mm: step.rms,
        });
        match (done, clip) {
            (true, Clip::Narrow) => break,
            // Near convergence outliers stand out clearly, so the limit can be tight.
            (true, Clip::Wide) => clip = Clip::Narrow,
            (false, Clip::Wide) if iteration >= options.max_iterations / 2 => clip = Clip::Narrow,
            (false, _) => {}
        }
    }
    result.ok_or_else(|| {
        Error::input(
            "cloud",
            "no part of it lies near the truth",
            "a cloud within a few centimetres of the truth",
        )
    })
}
