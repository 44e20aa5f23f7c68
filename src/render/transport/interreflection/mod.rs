//! Interreflection: one diffuse bounce of the light of the projector and of lamps.
//!
//! The indirect irradiance of a point is the integral of the incoming radiance over the point's
//! hemisphere. For cosine-distributed rays it is the mean of albedo times irradiance at the points
//! that they hit (e.g. Pharr, Jakob, Humphreys: "Physically Based Rendering", 4th edition, section
//! 13.2). The hits do not depend on the projected pattern. The geometry pass therefore traces the
//! rays once and stores, for each ray that ends in the projector's light, a pattern position, a
//! footprint and a weight; each frame then averages its pattern over these footprints
//! ([`exposure`](crate::exposure)). The indirect light of lamps is added to the ambient light.
//!
//! Each ray represents a solid angle, which maps to a parallelogram on the pattern. Without this
//! footprint, each ray would sample a fringe at a random phase, and the mean of 64 rays would still
//! fluctuate by an eighth of the rays' contribution.
//!
//! Indirect light varies slowly, so it is gathered at some pixels and interpolated over each smooth
//! surface (`grid`); `error` estimates the error of this interpolation, and chooses the spacing. A
//! mixed pixel uses the value at its centre. `gather` casts the rays in the directions of
//! `hemisphere`, and `patch` computes the reflectance and the light at the points that they hit.

mod error;
mod gather;
mod grid;
mod hemisphere;
mod patch;

use super::rays::Rays;
use crate::exposure::{GeometryBuffer, InterreflectionMap};
use crate::scene::Worlds;
use crate::{Plan, Term};
pub(crate) use error::Trial;
use gather::Gatherer;
use grid::Grid;
pub(crate) use hemisphere::Hemisphere;
pub(crate) use patch::Patch;

/// Fills the buffer's `interreflection` and adds the lamps' indirect light to its ambient maps.
pub(crate) fn run(worlds: &Worlds, rays: &Rays<'_>, plan: &Plan, map: &mut GeometryBuffer) {
    map.interreflection = InterreflectionMap::default();
    let Some(wanted) = rays.optics.interreflection else {
        return;
    };
    let grid = Grid::new(map, rays, wanted.step_px as usize);
    let gatherer = Gatherer::new(worlds, rays, plan, wanted.samples as usize);
    let (mut interreflection, lamps) = gatherer.gather(map, &grid.pixels);
    (
        interreflection.first,
        interreflection.shares,
        interreflection.stride,
    ) = (grid.first, grid.shares, grid.stride);
    if plan.has(Term::Lights) {
        add_lamps(map, &interreflection, &lamps);
    }
    map.interreflection = interreflection;
}

/// Adds the indirect light of lamps, which does not depend on the pattern. `lamps` holds the
/// irradiance and flicker amplitude of each gather point.
fn add_lamps(map: &mut GeometryBuffer, interreflection: &InterreflectionMap, lamps: &[[f32; 2]]) {
    let of = |which: usize| -> Vec<f32> {
        let mut points: Vec<f32> = lamps.iter().map(|point| point[which]).collect();
        points.resize(interreflection.padded(), 0.0);
        points
    };
    let steady = of(0);
    for (i, ambient) in map.ambient.iter_mut().enumerate() {
        *ambient += interreflection.at(i, &steady);
    }
    let swing = of(1);
    for (i, flickering) in map.flickering.iter_mut().enumerate() {
        *flickering += interreflection.at(i, &swing);
    }
    let mut former = None;
    for mixed in &mut map.mixed {
        // The sample groups of a pixel are summed, so the light is added only to the first group.
        if former != Some(mixed.pixel) {
            mixed.ambient += interreflection.at(mixed.pixel as usize, &steady);
            mixed.flickering += interreflection.at(mixed.pixel as usize, &swing);
            former = Some(mixed.pixel);
        }
    }
}
