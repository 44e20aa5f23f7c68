//! Runs the geometry pass on the GPU (`geometry.wgsl`) and allocates its maps (`maps_in.wgsl` and
//! `maps_out.wgsl`).

#[cfg(test)]
mod functions;
#[cfg(test)]
pub(super) mod tests;

use super::{Commands, Engine, EntryPoint, grid};
use crate::{Plan, Term};
use glam::DVec2;
use phasmid_core::error::Result;
use phasmid_geometry::Lens;

/// Side of a workgroup's tile in pixels, as in `geometry.wgsl`.
const SIDE: usize = 8;

/// Uploads a table of the ideal image points of the camera's pixels, computed in f64, if the
/// camera's lens has distortion.
pub(crate) fn write_rays(engine: &mut Engine, table: Option<&[DVec2]>) {
    let rays: Vec<[f32; 2]> = table
        .unwrap_or_default()
        .iter()
        .map(|p| p.as_vec2().to_array())
        .collect();
    engine.write("rays", bytemuck::cast_slice(&rays));
}

/// Adds the pass over all pixel centres. Scene, optics and rays must already have been uploaded.
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
    reserve_maps(engine, width * height);
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

/// Allocates the maps for `pixels` pixels.
pub(crate) fn reserve_maps(engine: &mut Engine, pixels: usize) {
    let pixels = pixels as u64;
    for (name, bytes) in [
        ("place", 8),
        ("slopes", 16),
        ("light", 8),
        ("seen", 16),
        ("surface", 4),
        ("marks", 4),
        ("lamp_bits", 4),
        ("flickering", 4),
        ("blur", 4),
        ("evenly", 4),
    ] {
        engine.reserve(name, pixels * bytes);
    }
}
