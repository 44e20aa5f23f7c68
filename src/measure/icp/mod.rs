//! Registration of a cloud onto a surface: point-to-plane iterative closest points (Y. Chen and G.
//! Medioni, "Object Modelling by Registration of Multiple Range Images", 1992), with Tukey's
//! biweight against outliers; degrees of freedom that the shape does not determine are left
//! unchanged.
//!
//! Each step minimises ((x + w x (x - c) + t - q) . n)^2, summed over points x with closest point q
//! and normal n. With rotations about the centroid c, and lengths in units of the RMS spread of the
//! points about it, the six unknowns have the same scale, and an eigenvalue of the 6 x 6 system
//! says how well its direction is determined: a plane leaves three directions free, a sphere three,
//! a cylinder two. The step does not move along free directions.
//!
//! The cutoff of the biweight starts wide. Whenever the motion has settled at a cutoff, the next one is
//! half as large, down to 4.685 robust standard deviations of the residuals. The cutoff never grows, so
//! the costs of successive steps are comparable, and pairs cannot alternate between two states for ever.

mod pairs;
mod step;
#[cfg(test)]
mod tests;

use super::metrics::finite_points;
use super::surface::Surface;
use glam::DVec3;
use pairs::{Scale, UNKNOWNS, pairs, weigh};
use phasmid_core::error::{Error, Result};
use phasmid_geometry::rotation::orthonormal;
use phasmid_geometry::{Cloud, Pose};
use serde::Serialize;
use step::Step;

/// Registration parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IcpOptions {
    /// Maximum number of steps, at least 1.
    pub max_iterations: usize,
    /// Maximum number of points used, taken evenly along the cloud.
    pub max_points: usize,
    /// A step that moves the points by at most this fraction of the cloud's spread is a rounding
    /// error: the motion has converged.
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

/// A step of fewer than this many standard deviations of the estimate counts as convergence.
const STEP_SIGMAS: f64 = 1e-3;
/// Before the last cutoff, the motion has settled once a step changes the residuals by less than this
/// fraction of the cutoff (RMS).
const SETTLED: f64 = 0.003;
/// Minimum step along a direction, in standard deviations, before the last cutoff: without this limit,
/// outliers would push the motion far along poorly determined directions.
const WIDE_SIGMAS: f64 = 3.0;
/// Minimum relative decrease of the cost that counts as a fall.
const COST_FALL: f64 = 1e-6;
/// Number of successive steps without a fall of the cost after which the motion has settled.
const STALLED_STEPS: usize = 3;

/// Result of a registration.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Alignment {
    /// Maps coordinates in the cloud's frame to the truth's frame, in millimetres.
    pub truth_from_cloud: Pose,
    /// Number of steps.
    pub iterations: usize,
    /// Whether, at the final cutoff, the last step was below 0.001 standard deviations of the
    /// estimate or below the tolerance, or the robust cost no longer fell by a relative 1e-6.
    pub converged: bool,
    /// Displacement of the points by the last step in millimetres: its translation plus its rotation
    /// times the spread of the points.
    pub last_step_mm: f64,
    /// Rotation of the last step in degrees.
    pub last_step_deg: f64,
    /// Length of the last step in standard deviations of the estimated motion. These standard deviations
    /// assume independent residuals.
    pub last_step_sigmas: f64,
    /// Robust standard deviation of the distances to the tangent planes, in millimetres: 1.4826 times
    /// the median absolute distance over all pairs, at least the rounding error of the coordinates.
    pub robust_scale_mm: f64,
    /// Number of the six degrees of freedom that the shape determines.
    pub determined: usize,
    /// Largest over smallest singular value of the system in the determined directions.
    pub condition: f64,
    /// Number of points with a positive weight in the last step.
    pub points: usize,
    /// Fraction of the pairs with a positive weight, 0 to 1. Points beside the surface form no pair.
    pub kept: f64,
    /// Fraction of the pairs rejected as outliers, 0 to 1.
    pub rejected: f64,
    /// RMS distance in millimetres to the tangent planes, over the points used in the first step.
    pub rms_before_mm: f64,
    /// RMS distance in millimetres to the tangent planes, over the points used in the last step.
    pub rms_after_mm: f64,
}

/// Finds the rigid motion that aligns a cloud with a nearby surface, both in millimetres.
///
/// # Errors
/// Returns an error if the cloud has no finite point, if no point lies over the surface, or if fewer
/// than six pairs have a positive weight.
pub fn align(cloud: &Cloud, surface: &Surface, options: &IcpOptions) -> Result<Alignment> {
    let all = finite_points(cloud)?;
    let stride = all.len().div_ceil(options.max_points.max(1));
    let points: Vec<DVec3> = all.iter().copied().step_by(stride).collect();
    // Residuals below this value are rounding errors, because coordinates are read as f32.
    let largest = points.iter().map(|p| p.abs().max_element());
    let floor = f64::from(f32::EPSILON) * largest.fold(1e-3, f64::max);
    let mut pose = Pose::IDENTITY;
    let (mut cutoff, mut least_cost, mut stalled) = (f64::INFINITY, f64::INFINITY, 0);
    let (mut iterations, mut rms_before) = (0, None);
    loop {
        iterations += 1;
        let moved: Vec<DVec3> = points.iter().map(|&p| pose.point(p)).collect();
        let pairs = pairs(&moved, &surface.closest_batch(&moved));
        if pairs.is_empty() {
            return Err(Error::input(
                "cloud",
                "no part of it lies near the truth",
                "a cloud within a few centimetres of the truth",
            ));
        }
        let scale = Scale::new(&pairs, floor);
        cutoff = cutoff.min(scale.wide);
        let weighed = weigh(&pairs, cutoff, points.len() - pairs.len());
        let kept = weighed.kept.len();
        if kept < UNKNOWNS {
            return Err(Error::input(
                "cloud",
                format!("too few points match the truth, found {kept}"),
                format!("at least {UNKNOWNS}, which determine a rigid motion"),
            ));
        }
        // With the final pairs, the scale still changes by up to 1 % from step to step.
        let last = cutoff <= 1.01 * scale.cutoff;
        let min_sigmas = if last { 0.0 } else { WIDE_SIGMAS };
        let step = Step::solve(&weighed.kept, options.free_below, min_sigmas);
        pose = step.motion() * pose;
        // Re-orthonormalise: products of many rotations drift.
        pose.rotation = orthonormal(pose.rotation);
        if weighed.cost < least_cost * (1.0 - COST_FALL) {
            (least_cost, stalled) = (weighed.cost, 0);
        } else {
            stalled += 1;
        }
        let sigmas = step.sigmas(scale.robust);
        let still = stalled >= STALLED_STEPS
            || sigmas <= STEP_SIGMAS
            || step.size() <= options.tolerance * step.spread;
        let share = kept as f64 / pairs.len() as f64;
        let converged = still && last;
        let found = Alignment {
            truth_from_cloud: pose,
            iterations,
            converged,
            last_step_mm: step.size(),
            last_step_deg: step.degrees(),
            last_step_sigmas: sigmas,
            robust_scale_mm: scale.robust,
            determined: step.determined,
            condition: step.condition,
            points: kept,
            kept: share,
            rejected: 1.0 - share,
            rms_before_mm: *rms_before.get_or_insert(step.rms),
            rms_after_mm: step.rms,
        };
        if converged || iterations >= options.max_iterations {
            return Ok(found);
        }
        if !last && (still || step.effect <= SETTLED * cutoff) {
            cutoff = scale.cutoff.max(cutoff / 2.0);
            (least_cost, stalled) = (f64::INFINITY, 0);
        }
    }
}
