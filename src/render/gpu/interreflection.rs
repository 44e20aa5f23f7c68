//! Interreflection on the GPU: gather points and their rays. Twin of `interreflection/mod.rs`.
//!
//! Each point reserves space for all its rays: 16 bytes per ray and per axis along which patterns
//! vary. Rays that carry light come first. With 64 rays at every fourth column and row, and at
//! pixels that cannot be interpolated, this is about 40 MB per axis for a camera of 1138 x 489
//! pixels. Exceeding the GPU's maximum buffer size is an error.

use super::{Engine, EntryPoint, engine, grid};
use crate::exposure::Gathering;
use crate::transport::interreflection::Hemisphere;
use crate::{Plan, Term};
use bytemuck::{Pod, Zeroable};
use phasmid_core::error::{Error, Result};

/// Bytes per ray and pattern axis.
const RAY: u64 = 16;
/// Bytes per gather point.
const POINT: u64 = 16;

/// Twin of `InterreflectionParams` in `interreflection_types.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
struct Params {
    size: [u32; 2],
    /// Number of columns and rows of the grid of gather points.
    places: [u32; 2],
    step: u32,
    samples: u32,
    points: u32,
    spare: u32,
}

/// Twin of `GatherPoint` in `interreflection_types.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(crate) struct Point {
    pub(crate) pixel: u32,
    pub(crate) first: u32,
    pub(crate) kept: u32,
    pub(crate) white: f32,
}

impl Params {
    fn new(wanted: Gathering, size: [usize; 2]) -> Self {
        let size = size.map(|side| side as u32);
        let step = wanted.step_px;
        // Gather points are at every `step`th pixel and at the last pixel.
        let places = |count: u32| (count - 1).div_ceil(step) + 1;
        Self {
            size,
            places: size.map(places),
            step,
            samples: wanted.samples,
            ..Self::default()
        }
    }

    fn on_grid(&self) -> u32 {
        self.places[0] * self.places[1]
    }
}

/// Gathers indirect light for the maps that are already on the GPU, and adds the indirect light of
/// lamps to the ambient maps. Waits for the GPU once, since the number of gather points determines
/// the memory to allocate.
///
/// # Errors
/// Returns an error if the points do not fit in memory or if the GPU has failed.
pub(crate) fn run(
    engine: &mut Engine,
    wanted: Gathering,
    plan: &Plan,
    size: [usize; 2],
) -> Result<()> {
    let mut params = Params::new(wanted, size);
    let pixels = size[0] * size[1];
    shares(engine, &params, plan)?;
    params.points = engine::words::<u32>(engine, "interreflection_count", 1)?[0];
    reserve(engine, &params, plan)?;
    engine.write("interreflection_params", bytemuck::bytes_of(&params));
    engine.write(
        "interreflection_disc",
        bytemuck::cast_slice(&disc(wanted.samples)),
    );
    let mut commands = engine.commands();
    let points = EntryPoint::new("grid", "points", plan);
    engine.run(&mut commands, &points, grid(params.on_grid() as usize))?;
    engine.run(
        &mut commands,
        &EntryPoint::new("grid", "alone", plan),
        grid(pixels),
    )?;
    let gather =
        EntryPoint::new("gather", "main", plan).with("rays_a_point", wanted.samples.into());
    // One workgroup per gather point.
    engine.run(&mut commands, &gather, grid(64 * params.points as usize))?;
    if plan.has(Term::Lights) {
        engine.run(
            &mut commands,
            &EntryPoint::new("add_lamps", "main", plan),
            grid(pixels),
        )?;
        let mixed = EntryPoint::new("add_lamps", "mixed", plan);
        engine.run_indirect(&mut commands, &mixed, "mixed_count", 4)?;
    }
    engine.submit(commands);
    Ok(())
}

/// Determines the gather points from which each pixel is interpolated, and counts the points in
/// `interreflection_count`.
fn shares(engine: &mut Engine, params: &Params, plan: &Plan) -> Result<()> {
    let pixels = u64::from(params.size[0]) * u64::from(params.size[1]);
    engine.write("interreflection_params", bytemuck::bytes_of(params));
    engine.write(
        "interreflection_count",
        bytemuck::bytes_of(&params.on_grid()),
    );
    engine.reserve("interreflection_first", 4 * pixels);
    engine.reserve("interreflection_shares", 16 * pixels);
    let mut commands = engine.commands();
    engine.run(
        &mut commands,
        &EntryPoint::new("grid", "shares", plan),
        grid(pixels as usize),
    )?;
    engine.submit(commands);
    Ok(())
}

/// Allocates buffers for gather points and rays.
fn reserve(engine: &mut Engine, params: &Params, plan: &Plan) -> Result<()> {
    let points = u64::from(params.points);
    let bytes = points * u64::from(params.samples) * RAY;
    let most = engine.gpu().largest_buffer();
    if bytes > most {
        return Err(Error::device(format!(
            "interreflection by {} rays at {points} points takes {bytes} bytes in one GPU buffer, \
             which holds up to {most}: use a larger step_px or fewer samples",
            params.samples
        )));
    }
    engine.reserve("interreflection_points", points * POINT);
    engine.reserve("interreflection_lamps", 8 * points);
    for (name, term) in [
        ("interreflection_x", Term::FootprintX),
        ("interreflection_y", Term::FootprintY),
    ] {
        engine.reserve(name, if plan.has(term) { bytes } else { 0 });
    }
    Ok(())
}

/// Returns for each direction its position on the disc below the hemisphere, its height above the
/// disc, and the divisor for the sides of the direction's patch.
fn disc(samples: u32) -> Vec<[f32; 4]> {
    let hemisphere = Hemisphere::new(samples as usize);
    let lowest = hemisphere.lowest();
    let point = |p: glam::DVec2| {
        let height = (1.0 - p.length_squared()).max(0.0).sqrt();
        [p.x, p.y, height, height.max(lowest)].map(|v| v as f32)
    };
    hemisphere.points().map(point).collect()
}

#[cfg(test)]
mod tests;
