//! Registration of a cloud onto a surface: point-to-plane iterative closest points (Y. Chen and
//! G. Medioni, "Object Modelling by Registration of Multiple Range Images", 1992), with outliers
//! left out and directions that the shape does not determine left alone.
//!
//! Each step minimises the sum over points x with foot q and normal n of ((x + w x (x - c) + t - q)
//! . n)^2. With rotations about the centroid c, and lengths in units of the points' spread about it,
//! the six unknowns are of one size, and an eigenvalue of the 6 x 6 system says how well its
//! direction is held: a plane leaves three free, a sphere three, a cylinder two. Those are not moved
//! along.

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

/// How to register.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IcpOptions {
    /// Steps at most.
    pub max_iterations: usize,
    /// Points used at most, taken evenly along the cloud.
    pub max_points: usize,
    /// Done when a step moves no point by more than this part of the cloud's spread.
    pub tolerance: f64,
    /// Directions whose eigenvalue is below this part of the largest are left alone: 1e-5 is a
    /// slope of 0.3 % RMS.
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

/// The motion found, and how far to trust it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Alignment {
    /// Takes the cloud's coordinates to the truth's, in millimetres.
    pub truth_from_cloud: Pose,
    /// Steps made.
    pub iterations: usize,
    /// Whether the last step was below the tolerance.
    pub converged: bool,
    /// How many of the six degrees of freedom the shape determines.
    pub determined: usize,
    /// Largest over smallest singular value of the system in those directions.
    pub condition: f64,
    /// Points that took part in the last step.
    pub points: usize,
    /// RMS distance to the tangent planes of the points that took part in the first step, in mm.
    pub rms_before_mm: f64,
    /// The same of the last step.
    pub rms_after_mm: f64,
}

/// Finds the motion that brings a cloud onto a surface from nearby, both in millimetres.
///
/// # Errors
/// A cloud without a finite point, or one of which nothing faces the surface.
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
        // Products of many rotations drift off; this keeps them rotations to rounding.
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
            // Near the end outliers stand out clearly, so the limit can be tight.
            (true, Clip::Wide) => clip = Clip::Narrow,
            (false, Clip::Wide) if iteration >= options.max_iterations / 2 => clip = Clip::Narrow,
            (false, _) => {}
        }
    }
    result.ok_or_else(|| {
        Error::input(
            "cloud",
            "no part of it lies over the truth",
            "a cloud within a few centimetres of the truth",
        )
    })
}
