//! Skin on the GPU: the tissues of a scene, where light comes from and how far it spreads. Twin of
//! `skin/maps.rs`.

use super::engine::Commands;
use super::{Engine, Stage, grid};
use crate::emulator::render::Plan;
use crate::emulator::render::buffer::GeometryBuffer;
use crate::emulator::render::skin::{Component, MOST, NONE, Skins};
use crate::error::Result;
use bytemuck::{Pod, Zeroable};

/// Twin of `UnderSkin` in `skin_types.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
struct UnderSkin {
    origin: [f32; 2],
    px_per_mm: [f32; 2],
    tissue: u32,
    unused: u32,
}

impl UnderSkin {
    fn new(origin: [f32; 2], (px_per_mm, tissue): ([f32; 2], u16)) -> Self {
        Self {
            // Nowhere is 0 rather than NaN.
            origin: origin.map(|v| if v.is_finite() { v } else { 0.0 }),
            px_per_mm,
            tissue: tissue.into(),
            unused: 0,
        }
    }
}

/// Takes the scene's tissues to the GPU: buffers `mixtures` and `skin_of`.
pub(in crate::emulator::render) fn write(engine: &mut Engine, skins: &Skins) {
    let gaussian = |c: &Component| [c.weight, c.sigma_mm, c.reach, 0.0].map(|v| v as f32);
    let mut mixtures = Vec::new();
    for mixture in skins.mixtures() {
        let mut gaussians: Vec<_> = mixture.components().iter().map(gaussian).collect();
        gaussians.resize(MOST, [0.0; 4]);
        mixtures.extend(gaussians);
    }
    let of: Vec<[u32; 2]> = skins
        .of_objects()
        .map(|(tissue, shift_mm)| [tissue.into(), (shift_mm as f32).to_bits()])
        .collect();
    engine.write("mixtures", bytemuck::cast_slice(&mixtures));
    engine.write("skin_of", bytemuck::cast_slice(&of));
}

/// Room for the samples of so many heads of mixed pixels: `mixed_skin`.
pub(in crate::emulator::render) fn reserve_samples(engine: &mut Engine, heads: usize) {
    engine.reserve("mixed_skin", 16 * (heads * size_of::<UnderSkin>()) as u64);
}

/// Follows the light of all pixels' centres: fills `under_skin`.
///
/// # Errors
/// A GPU that has failed.
pub(in crate::emulator::render) fn run(
    engine: &mut Engine,
    commands: &mut Commands,
    plan: &Plan,
    pixels: usize,
) -> Result<()> {
    engine.reserve("under_skin", (pixels * size_of::<UnderSkin>()) as u64);
    engine.run(commands, &Stage::new("skin_maps", "main", plan), grid(pixels))
}

/// Takes what the CPU's geometry pass has found to the GPU, in the order of its mixed pixels.
pub(in crate::emulator::render) fn upload(engine: &mut Engine, map: &GeometryBuffer) {
    let Some(skin) = &map.skin else { return };
    let pixels = 0..map.x.len();
    let pixels = pixels.map(|i| UnderSkin::new(skin.from.each_ref().map(|from| from[i]), skin.at(i)));
    let samples = map.mixed.iter().flat_map(|mixed| {
        (0..16).map(|k| {
            let none = ([0.0; 2], NONE);
            let skin = mixed.skin.as_ref().map_or(none, |samples| samples.at(k));
            UnderSkin::new([mixed.x[k], mixed.y[k]], skin)
        })
    });
    let (pixels, samples): (Vec<_>, Vec<_>) = (pixels.collect(), samples.collect());
    engine.write("under_skin", bytemuck::cast_slice(&pixels));
    engine.write("mixed_skin", bytemuck::cast_slice(&samples));
}
