//! Per-pixel maps in GPU memory: `maps_in.wgsl` and `maps_out.wgsl`.

use super::Engine;
use phasmid_core::error::Result;

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

/// Reads the first `count` elements of a buffer.
pub(crate) fn words<T: bytemuck::Pod>(engine: &Engine, name: &str, count: u64) -> Result<Vec<T>> {
    let bytes = engine.read_back(name, 0..count * size_of::<T>() as u64)?;
    Ok(bytemuck::pod_collect_to_vec(&bytes))
}
