//! What objects look like, and the lamps, as shaders read them: `looks.wgsl`, `look_values.wgsl` and
//! `texture.wgsl`.

mod pack;
mod tables;
#[cfg(test)]
mod tests;

use super::Engine;
use crate::emulator::render::lamps::{Lamp, LampShape};
use crate::emulator::render::shade::Optics;
use crate::emulator::render::worlds::Worlds;
use pack::Packer;

/// Room for the lamps in front of the look's values.
const LAMPS: usize = 32 * 8;

/// Takes all looks and lamps of a scene to the GPU, with meshes in the shapes that they have now:
/// buffers `looks`, `look_values` and `texel_sums`.
pub(in crate::emulator::render) fn write(engine: &mut Engine, optics: &Optics, worlds: &Worlds) {
    let mut values: Vec<f32> = optics.lamps.iter().flat_map(lamp).collect();
    values.resize(LAMPS, 0.0);
    values.extend(tables::soft());
    let mut packer = Packer::new(values);
    packer.objects(worlds.shapes());
    engine.write("looks", bytemuck::cast_slice(&packer.looks));
    engine.write("look_values", bytemuck::cast_slice(&packer.values));
    engine.write("texel_sums", bytemuck::cast_slice(&packer.sums));
}

/// Twin of `lamp_number` in `lamp.wgsl`.
fn lamp(lamp: &Lamp) -> [f32; 8] {
    let (at, power, is_point) = match lamp.shape {
        LampShape::Point { at, intensity_w_sr } => (at, intensity_w_sr, 1.0),
        LampShape::Directional {
            towards,
            irradiance_w_m2,
        } => (towards, irradiance_w_m2, 0.0),
    };
    let [x, y, z] = at.to_array();
    [x, y, z, power, is_point, lamp.depth, 0.0, 0.0].map(|v| v as f32)
}
