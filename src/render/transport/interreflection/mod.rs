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

use super::input::Input;
use crate::Term;
use crate::exposure::{GeometryBuffer, InterreflectionMap};
pub(crate) use error::Trial;
use gather::Gatherer;
use grid::{Grid, Lattice};
pub(crate) use hemisphere::Hemisphere;
pub(crate) use patch::Patch;
use rayon::prelude::*;

/// Minimum difference in light of a gather point between two key instants that counts, as a fraction
/// of the light of its pixel.
const DIFFERENT: f32 = 0.02;

/// Fills the buffer's `interreflection` and adds the lamps' indirect light to its ambient maps.
pub(crate) fn run(input: &Input<'_>, map: &mut GeometryBuffer) {
    let Input { rays, plan, .. } = *input;
    map.interreflection = InterreflectionMap::default();
    let Some(wanted) = rays.optics.interreflection else {
        return;
    };
    let grid = Grid::new(map, rays, wanted.step_px as usize);
    let gatherer = Gatherer::new(input.worlds, rays, plan, wanted.samples as usize);
    let mut found = gatherer.gather(map, &grid.pixels);
    (found.first, found.shares, found.stride) = (grid.first, grid.shares, grid.stride);
    map.interreflection = found;
    if plan.has(Term::Lights) {
        let mixed: Vec<u32> = map.mixed.iter().map(|mixed| mixed.pixel).collect();
        add_lamps(map, 0..map.flags.len(), &mixed);
    }
}

/// Fills the buffer's `interreflection` with the light at the gather points of a key instant. The pixels
/// `traced`, which may see other surfaces than at that instant, take the light of gather points on their
/// own surface; light is gathered for them if there are none. Adds the lamps' indirect light to these
/// pixels and to the mixed pixels that are in `sampled`.
pub(super) fn between(
    input: &Input<'_>,
    key: &GeometryBuffer,
    [traced, sampled]: [&[u32]; 2],
    map: &mut GeometryBuffer,
) {
    let Input { rays, plan, .. } = *input;
    let Some(wanted) = rays.optics.interreflection else {
        return;
    };
    let mut found = key.interreflection.clone();
    let lattice = Lattice::new([map.width, map.height], wanted.step_px as usize);
    let view = &*map;
    let place = |&pixel: &u32| lattice.place(pixel as usize, view, key, rays);
    let places: Vec<_> = traced.par_iter().map(place).collect();
    let mut alone = Vec::new();
    for (&pixel, place) in traced.iter().zip(places) {
        let pixel = pixel as usize;
        let (first, shares) = match place {
            None => (0, [0.0; 4]),
            Some((first, Some(shares))) => (first, shares),
            Some((_, None)) => {
                alone.push(Some(pixel));
                let last = found.ends.len() + alone.len() - 1;
                (last as u32, [map.evenly[pixel], 0.0, 0.0, 0.0])
            }
        };
        (found.first[pixel], found.shares[pixel]) = (first, shares);
    }
    let gatherer = Gatherer::new(input.worlds, rays, plan, wanted.samples as usize);
    found.append(gatherer.gather(map, &alone));
    map.interreflection = found;
    if plan.has(Term::Lights) {
        let mixed = map.mixed.iter().map(|mixed| mixed.pixel);
        let mixed: Vec<u32> = mixed
            .filter(|pixel| sampled.binary_search(pixel).is_ok())
            .collect();
        add_lamps(map, traced.iter().map(|pixel| *pixel as usize), &mixed);
    }
}

/// Returns the fraction of the gather points of a grid, lit by the projector, at which indirect light
/// differs between two key instants by more than [`DIFFERENT`]. Leaves out pixels that are in `traced`.
pub(super) fn difference(step: usize, [a, b]: [&GeometryBuffer; 2], traced: &[u32]) -> f64 {
    let lattice = Lattice::new([a.width, a.height], step);
    let differs = |(k, pixel): (usize, usize)| {
        let indirect = |key: &GeometryBuffer| key.interreflection.white[k] * key.evenly[pixel];
        let [one, other] = [a, b].map(indirect);
        let light = a.projected[pixel] + a.ambient[pixel] + one.max(other);
        (one - other).abs() > DIFFERENT * light && traced.binary_search(&(pixel as u32)).is_err()
    };
    let mut pixels = lattice.pixels().into_iter().enumerate().collect::<Vec<_>>();
    pixels.retain(|(_, pixel)| a.projected[*pixel] > 0.0);
    let all = pixels.len().max(1) as f64;
    pixels.into_iter().filter(|of| differs(*of)).count() as f64 / all
}

/// Adds the indirect light of lamps, which does not depend on the pattern, to some pixels and to some of
/// the mixed pixels, which are in order.
fn add_lamps(map: &mut GeometryBuffer, pixels: impl Iterator<Item = usize>, mixed: &[u32]) {
    let interreflection = &map.interreflection;
    let of = |which: usize| -> Vec<f32> {
        let lamps = interreflection.lamps.iter();
        let mut points: Vec<f32> = lamps.map(|point| point[which]).collect();
        points.resize(interreflection.padded(), 0.0);
        points
    };
    let (steady, swing) = (of(0), of(1));
    for i in pixels {
        map.ambient[i] += interreflection.at(i, &steady);
        if let Some(flickering) = map.flickering.get_mut(i) {
            *flickering += interreflection.at(i, &swing);
        }
    }
    let mut former = None;
    for of_pixel in &mut map.mixed {
        let pixel = of_pixel.pixel;
        // The sample groups of a pixel are summed, so the light is added only to the first group.
        if former != Some(pixel) && mixed.binary_search(&pixel).is_ok() {
            of_pixel.ambient += interreflection.at(pixel as usize, &steady);
            of_pixel.flickering += interreflection.at(pixel as usize, &swing);
            former = Some(pixel);
        }
    }
}
