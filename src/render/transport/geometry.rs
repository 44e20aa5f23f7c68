//! Geometry pass: computes, once per camera and scene state, what each pixel sees, the projector
//! coordinate of its light and how much light arrives.

use super::cast::{Cast, cast};
use super::input::Input;
use super::rays::Bundle;
use super::sampled::Sampler;
use super::{interreflection, mixed};
use crate::Term;
use crate::exposure::{Band, GeometryBuffer, KeyLevels, Optics, SkinMaps};
use crate::scene::{Layout, World};
use crate::truth::Truth;
use glam::DVec3;
use phasmid_geometry::raycast::{LANES, Scratch};
use rayon::prelude::*;

/// Fills the buffer: first the maps at each pixel's centre, then the samples of pixels that their
/// centres do not represent, then the maps that are computed from both.
pub(crate) fn run(input: &Input<'_>, buffer: &mut GeometryBuffer) {
    let occluders = input.find_occluders();
    let input = &input.with(occluders.as_ref());
    centers(input, buffer);
    if input.worlds.stop.is_asked() {
        return;
    }
    let depth_of_field = input.plan.has(Term::DepthOfField) && input.aperture.radius_mm > 0.0;
    let sampler = Sampler {
        input,
        side: input.options.side(depth_of_field),
    };
    buffer.mixed = match sampler.side {
        1 => mixed::run(input, buffer, &[]),
        2 => mixed::run(input, buffer, &sampler.uneven(buffer)),
        _ => sampler.gather(buffer),
    };
    complete(input, buffer);
}

/// Fills the buffer for a key instant, with one sample per pixel.
pub(crate) fn key(input: &Input<'_>, buffer: &mut GeometryBuffer) {
    let occluders = input.find_occluders();
    let input = &input.with(occluders.as_ref());
    centers(input, buffer);
    buffer.mixed = mixed::run(input, buffer, &[]);
    skin(input, buffer);
    if input.plan.has(Term::Interreflection) {
        interreflection::run(input, buffer);
    }
    blur(input, buffer, None);
}

/// Fills the maps with the surface and light that each pixel's centre sees.
fn centers(input: &Input<'_>, buffer: &mut GeometryBuffer) {
    let Input {
        worlds,
        optics,
        plan,
        ..
    } = *input;
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
                tile(world, input, &mut band, column, scratch);
            }
        });
}

/// Fills the maps with the surface and light that the centres of some pixels see. The pixels must be in
/// order.
pub(super) fn some_centers(input: &Input<'_>, pixels: &[u32], buffer: &mut GeometryBuffer) {
    let (width, height) = (buffer.width, buffer.height);
    // Only pixels that see the scene at one instant share a packet.
    let together = input.worlds.rows_together() > 1;
    let row = |pixel: u32| pixel as usize / width;
    let packets: Vec<_> = pixels
        .chunk_by(|a, b| together || row(*a) == row(*b))
        .flat_map(|pixels| pixels.chunks(LANES))
        .collect();
    let casts: Vec<_> = packets
        .par_iter()
        .map_init(Scratch::default, |scratch, pixels| {
            let world = &input.worlds.at(row(pixels[0]));
            // Lanes without a pixel repeat the last one.
            let pixel = |lane: usize| pixels[lane.min(pixels.len() - 1)] as usize;
            let direction = |lane| {
                let pixel = pixel(lane);
                input.rays.center(pixel % width, pixel / width)
            };
            let bundle = Bundle {
                origin: DVec3::ZERO,
                directions: std::array::from_fn(direction),
                used: std::array::from_fn(|lane| lane < pixels.len()),
                cell: 1.0,
            };
            let Input {
                optics,
                plan,
                occluders,
                ..
            } = *input;
            cast(world, optics, plan, &bundle, occluders, scratch)
        })
        .collect();
    for band in &mut buffer.bands(height) {
        for (pixels, cast) in packets.iter().zip(&casts) {
            for (lane, &pixel) in pixels.iter().enumerate() {
                write(band, pixel as usize, input.optics, cast, lane);
            }
        }
    }
}

/// Fills the maps that are computed from pixel centres and mixed samples: flags, skin, indirect
/// light and blur.
fn complete(input: &Input<'_>, buffer: &mut GeometryBuffer) {
    mark_mixed(buffer);
    if input.plan.has(Term::DepthOfField) {
        input.aperture.widen(buffer);
    }
    skin(input, buffer);
    if input.plan.has(Term::Interreflection) {
        interreflection::run(input, buffer);
    }
    blur(input, buffer, None);
}

/// Sets the flag of the mixed pixels.
pub(super) fn mark_mixed(buffer: &mut GeometryBuffer) {
    for mixed in &buffer.mixed {
        buffer.flags[mixed.pixel as usize] |= Truth::CREASE;
    }
}

/// Fills the skin maps, if the plan includes skin.
fn skin(input: &Input<'_>, buffer: &mut GeometryBuffer) {
    if input.plan.has(Term::Subsurface) {
        let world = input.worlds.any();
        buffer.skin = Some(SkinMaps::new(buffer, input.rays, input.optics, world));
    }
}

/// Computes the blur kernels of all footprints whose levels are not interpolated.
pub(super) fn blur(input: &Input<'_>, buffer: &mut GeometryBuffer, levels: Option<&KeyLevels<'_>>) {
    let pattern_image = &input.optics.projector.lens;
    let size = [
        pattern_image.width_px as usize,
        pattern_image.height_px as usize,
    ];
    buffer.blur_footprints(size, input.plan, levels);
}

fn tile(
    world: &World,
    input: &Input<'_>,
    band: &mut Band<'_>,
    column: usize,
    scratch: &mut Scratch,
) {
    let Input {
        optics,
        rays,
        plan,
        occluders,
        ..
    } = *input;
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
    let cast = cast(world, optics, plan, &bundle, occluders, scratch);
    for lane in (0..LANES).filter(|&lane| used[lane]) {
        let (u, v) = place(lane);
        write(band, v * width + u, optics, &cast, lane);
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
