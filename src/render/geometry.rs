//! Geometry pass: computes, once per camera and scene state, what each pixel sees, the projector
//! coordinate of its light and how much light arrives.

use super::aperture::Aperture;
use super::buffer::{Band, GeometryBuffer};
use super::sampled::Sampler;
use super::shade::{Optics, Shaded};
use super::skin::SkinMaps;
use super::world::{Hits, Surface, World};
use super::worlds::Worlds;
use super::{Options, Plan, Term, interreflection, material, mixed};
use crate::truth::Truth;
use glam::{DMat2, DVec2, DVec3};
use phasmid_geometry::raycast::{LANES, Scratch};
use rayon::prelude::*;

/// Side of the pixel tile covered by one ray packet.
pub(super) const TILE: usize = 4;

/// Arrangement of a packet's pixels: a square tile or, where rows are exposed at different times, a
/// segment of a row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    /// Binary logarithm of the number of columns.
    across: u32,
}

impl Layout {
    /// Returns the layout for `rows` rows: the side of a tile, or one.
    pub(super) fn of(rows: usize) -> Self {
        Self {
            across: if rows == TILE { 2 } else { 4 },
        }
    }

    /// Returns the column and row offset of a lane's pixel. Uses no division, whose cost would be
    /// noticeable next to the tracing.
    #[inline(always)]
    pub(super) fn place(self, lane: usize) -> (usize, usize) {
        (lane & ((1 << self.across) - 1), lane >> self.across)
    }
}

/// Directions of the camera's rays: computed, or looked up if the lens has distortion.
pub(super) struct Rays<'a> {
    pub(super) optics: &'a Optics,
    /// Ideal (undistorted) image points of all pixels, if the lens has distortion.
    pub(super) table: Option<&'a [DVec2]>,
    pub(super) width: usize,
}

impl Rays<'_> {
    /// Returns the direction, with z = 1, through a pixel's centre.
    pub(super) fn center(&self, column: usize, row: usize) -> DVec3 {
        match self.table {
            Some(table) => table[row * self.width + column].extend(1.0),
            None => self.through(DVec2::new(column as f64, row as f64)),
        }
    }

    /// Returns the derivatives of a direction, with z = 1, with respect to the pixel.
    pub(super) fn slope(&self, direction: DVec3) -> DMat2 {
        let lens = &self.optics.camera.lens;
        let scale = DMat2::from_diagonal(1.0 / lens.focal_px);
        match self.table {
            Some(_) => lens.distort_jacobian(direction.truncate()).inverse() * scale,
            None => scale,
        }
    }

    /// Returns the direction, with z = 1, through any image point.
    pub(super) fn through(&self, px: DVec2) -> DVec3 {
        self.optics.camera.lens.ray(px)
    }
}

/// Fills the buffer: first every pixel's centre, then the samples of pixels not represented by
/// their centre, which it flags as creases.
pub(super) fn run(
    worlds: &Worlds,
    optics: &Optics,
    rays: &Rays<'_>,
    plan: &Plan,
    options: Options,
    aperture: Aperture,
    buffer: &mut GeometryBuffer,
) {
    let lens = &optics.camera.lens;
    let (width, height) = (lens.width_px as usize, lens.height_px as usize);
    buffer.resize(width, height, plan);
    buffer.blur_stretch = (optics.defocus.aspect - 1.0) as f32;
    let rows = worlds.rows_together();
    buffer
        .bands(rows)
        .into_par_iter()
        .for_each_init(Scratch::default, |scratch, mut band| {
            if worlds.stop.is_asked() {
                return;
            }
            let world = &worlds.at(band.first_row);
            for column in (0..width).step_by(LANES / rows) {
                tile(world, optics, rays, plan, &mut band, column, scratch);
            }
        });
    if worlds.stop.is_asked() {
        return;
    }
    let depth_of_field = plan.has(Term::DepthOfField) && aperture.radius_mm > 0.0;
    let sampler = Sampler {
        worlds,
        optics,
        rays,
        plan,
        aperture,
        side: options.side(depth_of_field),
    };
    buffer.mixed = match sampler.side {
        1 => mixed::run(worlds, optics, rays, plan, buffer, &[]),
        2 => mixed::run(worlds, optics, rays, plan, buffer, &sampler.uneven(buffer)),
        _ => sampler.gather(buffer),
    };
    for mixed in &buffer.mixed {
        buffer.flags[mixed.pixel as usize] |= Truth::CREASE;
    }
    if plan.has(Term::DepthOfField) {
        aperture.widen(buffer);
    }
    if plan.has(Term::Subsurface) {
        buffer.skin = Some(SkinMaps::new(buffer, rays, optics, worlds.any()));
    }
    if plan.has(Term::Interreflection) {
        interreflection::run(worlds, rays, plan, buffer);
    }
    let pattern_image = &optics.projector.lens;
    let size = [
        pattern_image.width_px as usize,
        pattern_image.height_px as usize,
    ];
    buffer.blur_footprints(size, plan);
}

fn tile(
    world: &World,
    optics: &Optics,
    rays: &Rays<'_>,
    plan: &Plan,
    band: &mut Band<'_>,
    column: usize,
    scratch: &mut Scratch,
) {
    let width = rays.width;
    let rows = band.x.len() / width;
    let layout = Layout::of(band.rows);
    let place = |lane: usize| {
        let (right, down) = layout.place(lane);
        (column + right, down)
    };
    let used: [bool; LANES] = std::array::from_fn(|lane| {
        let (u, v) = place(lane);
        u < width && v < rows
    });
    let directions = std::array::from_fn(|lane| {
        let (u, v) = place(lane);
        // Lanes outside the image repeat a border pixel, which keeps the packet coherent.
        rays.center(u.min(width - 1), band.first_row + v.min(rows - 1))
    });
    let bundle = Bundle {
        origin: DVec3::ZERO,
        directions,
        used,
        cell: 1.0,
    };
    let cast = cast(world, optics, plan, &bundle, scratch);
    for lane in (0..LANES).filter(|&lane| used[lane]) {
        let (u, v) = place(lane);
        write(band, v * width + u, optics, &cast, lane);
    }
}

/// Sixteen camera rays to cast.
pub(super) struct Bundle {
    /// Origin: a point of the camera's pupil.
    pub(super) origin: DVec3,
    /// Directions, with z = 1.
    pub(super) directions: [DVec3; LANES],
    pub(super) used: [bool; LANES],
    /// Side in pixels of the square each ray represents.
    pub(super) cell: f64,
}

/// Sixteen cast rays with their hits and shading.
pub(super) struct Cast {
    /// Origin of the rays: a point of the camera's pupil.
    pub(super) origin: DVec3,
    pub(super) hits: Hits,
    pub(super) shaded: Shaded,
    /// Lanes lit by the projector.
    pub(super) lit: [bool; LANES],
}

/// Casts sixteen camera rays, and the shadow rays they need.
pub(super) fn cast(
    world: &World,
    optics: &Optics,
    plan: &Plan,
    bundle: &Bundle,
    scratch: &mut Scratch,
) -> Cast {
    let (origin, directions) = (bundle.origin, &bundle.directions);
    let hits = world.nearest(origin, directions, &bundle.used, scratch);
    let mut shaded = optics.shade(plan, origin, directions, &hits, world);
    // Skip shadow rays to points outside the projector's reach.
    let mut lit: [bool; LANES] =
        std::array::from_fn(|lane| hits.is_hit(lane) && shaded.reachable[lane]);
    if plan.has(Term::Shadows) && lit.contains(&true) {
        let points: [Option<(DVec3, Surface)>; LANES] = std::array::from_fn(|lane| {
            let point = DVec3::from_array(shaded.point.map(|axis| axis[lane]));
            lit[lane].then_some((origin + point, hits.surface[lane]))
        });
        let blocked = world.blocked(optics.projector.center(), &points, scratch);
        for lane in 0..LANES {
            lit[lane] &= !blocked[lane];
        }
    }
    if material::is_needed(plan) {
        let rays = material::Rays {
            world,
            optics,
            plan,
            bundle,
            hits: &hits,
        };
        material::apply(&rays, &mut shaded, scratch);
    }
    if plan.has(Term::CameraVignetting) {
        optics.dim_seen(directions, &mut shaded);
    }
    Cast {
        origin,
        hits,
        shaded,
        lit,
    }
}

impl Cast {
    /// Returns the hit point of a lane's ray, relative to its origin.
    pub(super) fn point(&self, lane: usize) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|axis| self.shaded.point[axis][lane]))
    }
}

#[inline(always)]
fn write(band: &mut Band<'_>, i: usize, optics: &Optics, cast: &Cast, lane: usize) {
    let (hits, shaded, lit) = (&cast.hits, &cast.shaded, cast.lit[lane]);
    band.surface[i] = hits.surface[lane].0;
    if !hits.is_hit(lane) {
        (band.x[i], band.y[i], band.depth[i]) = (f32::NAN, f32::NAN, f32::NAN);
        (band.projected[i], band.ambient[i], band.flags[i]) = (0.0, 0.0, 0);
        if let Some(kept) = band.flickering.get_mut(i) {
            *kept = 0.0;
        }
        if let Some(kept) = band.lamps.get_mut(i) {
            *kept = 0;
        }
        if let Some(kept) = band.evenly.get_mut(i) {
            *kept = 0.0;
        }
        return;
    }
    let slope = |axis: usize| shaded.footprint[axis].map(|by| by[lane] as f32);
    band.x[i] = shaded.px[0][lane] as f32;
    band.y[i] = shaded.px[1][lane] as f32;
    if let Some(kept) = band.x_slope.get_mut(i) {
        *kept = slope(0);
    }
    if let Some(kept) = band.y_slope.get_mut(i) {
        *kept = slope(1);
    }
    if let Some(kept) = band.blur.get_mut(i) {
        *kept = optics.blur_px(cast.origin + cast.point(lane));
    }
    band.projected[i] = if lit {
        shaded.projected[lane] as f32
    } else {
        0.0
    };
    band.ambient[i] = shaded.ambient[lane] as f32;
    if let Some(kept) = band.flickering.get_mut(i) {
        *kept = shaded.flickering[lane] as f32;
    }
    if let Some(kept) = band.lamps.get_mut(i) {
        *kept = shaded.lamps[lane];
    }
    if let Some(kept) = band.evenly.get_mut(i) {
        *kept = shaded.evenly[lane] as f32;
    }
    band.depth[i] = shaded.point[2][lane] as f32;
    band.normal[i] = hits.normal.map(|axis| axis[lane] as f32);
    band.flags[i] = Truth::SEEN
        | if lit { Truth::LIT } else { 0 }
        | if shaded.square[lane] {
            Truth::SQUARE
        } else {
            0
        };
}
