//! Interreflection: one diffuse bounce of the light of projector and lamps.
//!
//! The light that surfaces throw on a point is the integral of their radiance over its hemisphere.
//! Over rays spread by the cosine it is the mean of albedo times irradiance where they end (e.g.
//! Pharr, Jakob, Humphreys: "Physically Based Rendering", 4th edition, section 13.2). Where they
//! end does not change with the slide, so the geometry pass traces them once and keeps, for each
//! that ends in the projector's light, a place on the slide, a footprint and a weight; a frame then
//! averages its slide over them ([`light`](super::light)). The light of lamps joins the ambient
//! light.
//!
//! A ray stands for a solid angle, which is a parallelogram on the slide: without that footprint
//! each ray would pick a stripe of a fringe at random, and the mean of 64 would still sway by an
//! eighth of what they bring.
//!
//! Bounced light varies slowly, so it is gathered at every fourth pixel or so and interpolated over
//! each smooth surface (`grid`). A pixel on an edge has that of its centre.

mod gather;
mod grid;
mod hemisphere;
mod patch;

use super::buffer::GeometryBuffer;
use super::geometry::Rays;
use super::worlds::Worlds;
use super::{Plan, Term};
use gather::Gatherer;
use grid::Grid;
pub(super) use hemisphere::Hemisphere;

/// Rays whose slides are averaged side by side.
pub(super) const BLOCK: usize = 8;

/// What bounces, ready for frames.
#[derive(Debug, Clone, Default)]
pub(super) struct Bounce {
    /// Of each point at which light is gathered, the end of its blocks of rays.
    pub(super) ends: Vec<u32>,
    /// Irradiance in W/m^2 that each point has under full white.
    pub(super) white: Vec<f32>,
    /// Projector coordinates of the rays' ends; those that add nothing hold zeros. As in the maps,
    /// empty when no slide varies that way.
    pub(super) x: Vec<[f32; BLOCK]>,
    pub(super) y: Vec<[f32; BLOCK]>,
    /// Derivatives of the coordinates by the two sides of each ray's part of the hemisphere.
    pub(super) x_slope: Vec<[[f32; 2]; BLOCK]>,
    pub(super) y_slope: Vec<[[f32; 2]; BLOCK]>,
    /// Irradiance in W/m^2 that each ray brings under full white.
    pub(super) weight: Vec<[f32; BLOCK]>,
    /// Of each pixel, the first of the four points that it is interpolated from.
    pub(super) first: Vec<u32>,
    /// Electrons per second for 1 W/m^2 at each of them.
    pub(super) shares: Vec<[f32; 4]>,
    /// Points in a row of the grid: the four are `first`, the next, and those one row on.
    pub(super) stride: usize,
}

/// Fills the buffer's bounce, and adds what bounces of the lamps' light to its ambient maps.
pub(super) fn run(worlds: &Worlds, rays: &Rays<'_>, plan: &Plan, map: &mut GeometryBuffer) {
    map.bounce = Bounce::default();
    let Some(wanted) = rays.optics.interreflection else {
        return;
    };
    let grid = Grid::new(map, rays, wanted.step_px as usize);
    let gatherer = Gatherer::new(worlds, rays, plan, wanted.samples as usize);
    let (mut bounce, lamps) = gatherer.gather(map, &grid.pixels);
    (bounce.first, bounce.shares, bounce.stride) = (grid.first, grid.shares, grid.stride);
    if plan.has(Term::Lights) {
        add_lamps(map, &bounce, &lamps);
    }
    map.bounce = bounce;
}

impl Bounce {
    /// What a pixel has of a quantity that is known at the points.
    #[inline(always)]
    pub(super) fn at(&self, pixel: usize, points: &[f32]) -> f32 {
        let first = self.first[pixel] as usize;
        let [a, b, c, d] = self.shares[pixel];
        let (near, far) = (&points[first..], &points[first + self.stride..]);
        (a * near[0] + b * near[1]) + (c * far[0] + d * far[1])
    }

    /// How many points there are, with those that [`Self::at`] may touch beyond the last.
    pub(super) fn padded(&self) -> usize {
        self.ends.len() + self.stride + 2
    }
}

/// Adds light that no slide changes: of each point its irradiance, and by how much that swings.
fn add_lamps(map: &mut GeometryBuffer, bounce: &Bounce, lamps: &[[f32; 2]]) {
    let of = |which: usize| -> Vec<f32> {
        let mut points: Vec<f32> = lamps.iter().map(|point| point[which]).collect();
        points.resize(bounce.padded(), 0.0);
        points
    };
    let steady = of(0);
    for (i, ambient) in map.ambient.iter_mut().enumerate() {
        *ambient += bounce.at(i, &steady);
    }
    let swing = of(1);
    for (i, flickering) in map.flickering.iter_mut().enumerate() {
        *flickering += bounce.at(i, &swing);
    }
    let mut former = None;
    for mixed in &mut map.mixed {
        // The groups of a pixel's samples add up.
        if former != Some(mixed.pixel) {
            mixed.ambient += bounce.at(mixed.pixel as usize, &steady);
            mixed.flickering += bounce.at(mixed.pixel as usize, &swing);
            former = Some(mixed.pixel);
        }
    }
}
