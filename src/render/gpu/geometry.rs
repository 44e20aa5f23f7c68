//! Runs the geometry pass on the GPU: `geometry.wgsl`.

use super::{Commands, Engine, EntryPoint, grid, maps};
use crate::{Plan, Term};
use glam::DVec2;
use phasmid_core::error::Result;
use phasmid_geometry::Lens;

/// Side in pixels of a workgroup's tile, as in `geometry.wgsl`.
const SIDE: usize = 8;

/// Uploads the ideal image points of the camera's pixels, computed in f64, if its lens has
/// distortion.
pub(crate) fn write_rays(engine: &mut Engine, table: Option<&[DVec2]>) {
    let rays: Vec<[f32; 2]> = table
        .unwrap_or_default()
        .iter()
        .map(|p| p.as_vec2().to_array())
        .collect();
    engine.write("rays", bytemuck::cast_slice(&rays));
}

/// Adds the pass over all pixel centres; scene, optics and rays must already be uploaded.
///
/// # Errors
/// Returns an error if the GPU has failed.
pub(crate) fn run(
    engine: &mut Engine,
    commands: &mut Commands,
    plan: &Plan,
    camera: &Lens,
) -> Result<()> {
    let (width, height) = (camera.width_px as usize, camera.height_px as usize);
    maps::reserve_maps(engine, width * height);
    let tiles = width.div_ceil(SIDE) * height.div_ceil(SIDE);
    let stage = EntryPoint::new("geometry", "main", &of_geometry(plan));
    engine.run(commands, &stage, grid(tiles * SIDE * SIDE))
}

/// Reduces a plan to the terms that the geometry shaders use, so that other terms do not cause
/// recompilation.
fn of_geometry(plan: &Plan) -> Plan {
    let mut geometry = *plan;
    for term in Term::ALL {
        if term.pass() != crate::Pass::Geometry && term != Term::Flicker {
            geometry.set(term, false);
        }
    }
    geometry
}

#[cfg(test)]
mod functions;
#[cfg(test)]
pub(super) mod tests;
