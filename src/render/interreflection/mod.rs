//! Interreflection: one diffuse bounce of the light of projector and lamps.
//!
//! The indirect irradiance of a point is the integral of incoming radiance over its hemisphere. For
//! cosine-distributed rays it is the mean of albedo times irradiance at their hits (e.g. Pharr,
//! Jakob, Humphreys: "Physically Based Rendering", 4th edition, section 13.2). The hits do not
//! depend on the projected pattern, so the geometry pass traces the rays once and stores, for each
//! that ends in the projector's light, a pattern position, a footprint and a weight; each frame
//! then averages its pattern over them ([`exposure`](super::exposure)). The lamps' indirect light is
//! added to the ambient light.
//!
//! Each ray represents a solid angle, which maps to a parallelogram on the pattern. Without that
//! footprint each ray would sample a fringe at a random phase, and the mean of 64 rays would still
//! fluctuate by an eighth of their contribution.
//!
//! Indirect light varies slowly, so it is gathered at some pixels and interpolated over each smooth
//! surface (`grid`); `error` estimates how far that is off, and chooses the spacing. A mixed pixel uses
//! the value at its centre. `gather` casts the rays in the directions of `hemisphere`, and `patch`
//! computes the light where they hit.

mod error;
mod gather;
mod grid;
mod hemisphere;
mod patch;

use super::buffer::GeometryBuffer;
use super::geometry::Rays;
use super::worlds::Worlds;
use super::{Plan, Term};
pub(super) use error::Trial;
use gather::Gatherer;
use grid::Grid;
pub(super) use hemisphere::Hemisphere;
use phasmid_profile::Interreflection;

/// Number of rays per gather point, and spacing of the gather points in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Gathering {
    pub(super) samples: u32,
    pub(super) step_px: u32,
}

impl Gathering {
    /// The settings of a scene, or defaults until its error bound has determined them.
    pub(super) fn new(wanted: Interreflection) -> Self {
        Self {
            samples: wanted.samples.unwrap_or(64),
            step_px: wanted.step_px.unwrap_or(4),
        }
    }
}

/// Rays averaged together (SIMD block).
pub(super) const BLOCK: usize = 8;

/// Indirect light, prepared for the exposure of frames.
#[derive(Debug, Clone, Default)]
pub(super) struct InterreflectionMap {
    /// For each gather point, the end index of its blocks of rays.
    pub(super) ends: Vec<u32>,
    /// Irradiance of each gather point in W/m^2 under full white.
    pub(super) white: Vec<f32>,
    /// Projector coordinates of the rays' hits; zeros for padding rays. As in the maps, empty when
    /// no pattern varies along that axis.
    pub(super) x: Vec<[f32; BLOCK]>,
    pub(super) y: Vec<[f32; BLOCK]>,
    /// Derivatives of the coordinates along the two sides of each ray's patch of the hemisphere.
    pub(super) x_slope: Vec<[[f32; 2]; BLOCK]>,
    pub(super) y_slope: Vec<[[f32; 2]; BLOCK]>,
    /// Irradiance contributed by each ray under full white, in W/m^2.
    pub(super) weight: Vec<[f32; BLOCK]>,
    /// For each pixel, the first of the four points it is interpolated from.
    pub(super) first: Vec<u32>,
    /// Electrons per second for 1 W/m^2 at each of them.
    pub(super) shares: Vec<[f32; 4]>,
    /// Points per grid row: the four are `first`, the next one, and those one row below.
    pub(super) stride: usize,
}

/// Fills the buffer's `interreflection` and adds the lamps' indirect light to its ambient maps.
pub(super) fn run(worlds: &Worlds, rays: &Rays<'_>, plan: &Plan, map: &mut GeometryBuffer) {
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

impl InterreflectionMap {
    /// Interpolates a quantity given at the gather points for a pixel.
    #[inline(always)]
    pub(super) fn at(&self, pixel: usize, points: &[f32]) -> f32 {
        let first = self.first[pixel] as usize;
        let [a, b, c, d] = self.shares[pixel];
        let (near, far) = (&points[first..], &points[first + self.stride..]);
        (a * near[0] + b * near[1]) + (c * far[0] + d * far[1])
    }

    /// Returns the number of points, including those past the end that [`Self::at`] may access.
    pub(super) fn padded(&self) -> usize {
        self.ends.len() + self.stride + 2
    }
}

/// Adds the lamps' indirect light, which does not depend on the pattern: irradiance and flicker
/// amplitude of each point.
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
        // A pixel's sample groups are summed, so the light is added to the first only.
        if former != Some(mixed.pixel) {
            mixed.ambient += interreflection.at(mixed.pixel as usize, &steady);
            mixed.flickering += interreflection.at(mixed.pixel as usize, &swing);
            former = Some(mixed.pixel);
        }
    }
}
