//! Uploads the mixed pixels of the CPU's geometry pass.

use super::Engine;
use super::mixed::MixedSample;
use crate::exposure::{GeometryBuffer, Mixed};

impl MixedSample {
    fn new(mixed: &Mixed, k: usize) -> Self {
        Self {
            place: [mixed.x[k], mixed.y[k]],
            slopes: [mixed.x_slope[k], mixed.y_slope[k]],
            projected: mixed.projected[k],
            blur: mixed.blur[k],
        }
    }
}

/// Uploads the mixed pixels in order.
pub(crate) fn mixed(engine: &mut Engine, map: &GeometryBuffer) {
    let mut heads = Vec::with_capacity(map.mixed.len());
    for groups in map.mixed.chunk_by(|a, b| a.pixel == b.pixel) {
        for (i, mixed) in groups.iter().enumerate() {
            let count = if i == 0 { groups.len() as u32 } else { 0 };
            let [ambient, swing] = [mixed.ambient, mixed.flickering].map(f32::to_bits);
            heads.push([mixed.pixel, count, ambient, swing]);
        }
    }
    let all = |mixed: &Mixed| std::array::from_fn::<_, 16, _>(|k| MixedSample::new(mixed, k));
    let samples: Vec<_> = map.mixed.iter().flat_map(all).collect();
    let [across, down, _] = super::grid(heads.len());
    // Number of heads, workgroup counts for them, and number of heads needed.
    let count = [heads.len() as u32, across, down, 1, heads.len() as u32];
    engine.write("mixed_heads", bytemuck::cast_slice(&heads));
    engine.write("mixed_samples", bytemuck::cast_slice(&samples));
    engine.write("mixed_count", bytemuck::cast_slice(&count));
}
