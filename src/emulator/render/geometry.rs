//! The geometry pass: once per camera and state of the scene, per pixel what it sees, where on the
//! slide its light comes from, and how much of it arrives.

use super::buffer::{Band, GeometryBuffer, PackedNormal};
use super::sample::{Optics, Sample};
use super::world::{Hit, Surface, World};
use super::{Plan, mixed};
use crate::emulator::Truth;
use crate::geometry::raycast::LANES;
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Side of the tile of pixels that one packet of rays covers.
pub(super) const TILE: usize = 4;

/// Directions of the camera's rays: computed, or looked up where the lens is distorted.
pub(super) struct Rays<'a> {
    pub(super) optics: &'a Optics,
    /// Ideal image points of all pixels, where the lens is distorted.
    pub(super) table: Option<&'a [DVec2]>,
    pub(super) width: usize,
}

impl Rays<'_> {
    /// Direction with z = 1 through a pixel's centre.
    pub(super) fn center(&self, column: usize, row: usize) -> DVec3 {
        match self.table {
            Some(table) => table[row * self.width + column].extend(1.0),
            None => self.through(DVec2::new(column as f64, row as f64)),
        }
    }

    /// Direction with z = 1 through any point of the image.
    pub(super) fn through(&self, px: DVec2) -> DVec3 {
        self.optics.camera.lens.ray(px)
    }
}

/// Fills the buffer: first every pixel's centre, then the samples of mixed pixels.
pub(super) fn run(
    world: &World,
    optics: &Optics,
    rays: &Rays<'_>,
    plan: &Plan,
    buffer: &mut GeometryBuffer,
) {
    let lens = &optics.camera.lens;
    let (width, height) = (lens.width_px as usize, lens.height_px as usize);
    buffer.resize(width, height, plan);
    buffer
        .bands(TILE)
        .into_par_iter()
        .for_each_init(Vec::new, |stack, mut band| {
            for column in (0..width).step_by(TILE) {
                tile(world, optics, rays, plan, &mut band, column, stack);
            }
        });
    mixed::run(world, optics, rays, plan, buffer);
}

fn tile(
    world: &World,
    optics: &Optics,
    rays: &Rays<'_>,
    plan: &Plan,
    band: &mut Band<'_>,
    column: usize,
    stack: &mut Vec<(u32, f32)>,
) {
    let width = rays.width;
    let rows = band.x.len() / width;
    let place = |lane: usize| (column + lane % TILE, lane / TILE);
    let used: [bool; LANES] = std::array::from_fn(|lane| {
        let (u, v) = place(lane);
        u < width && v < rows
    });
    let directions: [DVec3; LANES] = std::array::from_fn(|lane| {
        let (u, v) = place(lane);
        // Lanes beyond the image repeat a pixel, so that the packet stays narrow.
        rays.center(u.min(width - 1), band.first_row + v.min(rows - 1))
    });
    let cast = cast(world, optics, plan, &directions, &used, stack);
    for lane in (0..LANES).filter(|&lane| used[lane]) {
        let (u, v) = place(lane);
        write(
            band,
            v * width + u,
            cast.hits[lane].as_ref(),
            &cast.samples[lane],
            cast.lit[lane],
        );
    }
}

/// Sixteen rays with all that is known of where they end.
pub(super) struct Cast {
    pub(super) hits: [Option<Hit>; LANES],
    /// Samples of the lanes that hit something.
    pub(super) samples: [Option<Sample>; LANES],
    /// Lanes that the projector lights.
    pub(super) lit: [bool; LANES],
}

/// Casts sixteen rays of the camera, and the shadow rays that matter.
pub(super) fn cast(
    world: &World,
    optics: &Optics,
    plan: &Plan,
    directions: &[DVec3; LANES],
    used: &[bool; LANES],
    stack: &mut Vec<(u32, f32)>,
) -> Cast {
    let hits = world.nearest(directions, used, stack);
    let samples: [Option<Sample>; LANES] = std::array::from_fn(|lane| {
        hits[lane].map(|hit| optics.sample(directions[lane], &hit, world))
    });
    // Rays to points that the projector cannot light anyway are not traced.
    let asked: [Option<(DVec3, Surface)>; LANES] = std::array::from_fn(|lane| {
        let (hit, sample) = (hits[lane]?, samples[lane]?);
        sample.reachable.then_some((sample.point, hit.surface))
    });
    let blocked = if plan.shadows && asked.iter().any(Option::is_some) {
        world.blocked(optics.projector.center(), &asked, stack)
    } else {
        [false; LANES]
    };
    Cast {
        hits,
        samples,
        lit: std::array::from_fn(|lane| asked[lane].is_some() && !blocked[lane]),
    }
}

fn write(band: &mut Band<'_>, i: usize, hit: Option<&Hit>, sample: &Option<Sample>, lit: bool) {
    let (Some(hit), Some(sample)) = (hit, sample) else {
        (band.x[i], band.y[i], band.depth[i]) = (f32::NAN, f32::NAN, f32::NAN);
        (band.projected[i], band.ambient[i], band.flags[i]) = (0.0, 0.0, 0);
        band.surface[i] = Surface::NONE.0;
        return;
    };
    band.x[i] = sample.projector_px.x as f32;
    band.y[i] = sample.projector_px.y as f32;
    let [by_column, by_row] = [sample.footprint.x_axis, sample.footprint.y_axis];
    if let Some(slope) = band.x_slope.get_mut(i) {
        *slope = [by_column.x as f32, by_row.x as f32];
    }
    if let Some(slope) = band.y_slope.get_mut(i) {
        *slope = [by_column.y as f32, by_row.y as f32];
    }
    band.projected[i] = if lit { sample.projected as f32 } else { 0.0 };
    band.ambient[i] = sample.ambient as f32;
    band.depth[i] = sample.point.z as f32;
    band.surface[i] = hit.surface.0;
    band.normal[i] = PackedNormal::new(hit.normal);
    band.flags[i] = Truth::SEEN
        | if lit { Truth::LIT } else { 0 }
        | if sample.square { Truth::SQUARE } else { 0 };
}
