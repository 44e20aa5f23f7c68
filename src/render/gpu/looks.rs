//! What objects look like, and the lamps, as shaders read them: `looks.wgsl`, `look_values.wgsl` and
//! `texture.wgsl`.
//!
//! All of it is taken to the GPU once. Each instant brings the smooth normals of meshes that deform:
//! the CPU, which deforms them, has made them.

#[cfg(test)]
mod board_tests;
#[cfg(test)]
mod map_tests;
mod pack;
mod tables;
#[cfg(test)]
mod tests;

use super::Engine;
use crate::lamps::{Lamp, LampShape};
use crate::path::Blend;
use crate::shade::Optics;
use crate::worlds::Worlds;
use pack::Packer;

/// Room for the lamps in front of the look's values.
const LAMPS: usize = 32 * 8;

/// What the GPU has of a scene's looks.
#[derive(Default)]
pub(crate) struct Looks {
    /// Shapes that meshes which deform are kept in; 0 before anything is there.
    shapes: usize,
    deforming: Vec<Deforming>,
}

/// The smooth normals of a mesh in one of its shapes.
struct Deforming {
    object: u16,
    shape: usize,
    /// Place among the look's values.
    at: u32,
    /// The shape that is there.
    blend: Option<Blend>,
}

impl Looks {
    /// Takes all looks and lamps there, with meshes in the shapes that they have now; of what is
    /// there already, only what has changed.
    pub(crate) fn update(&mut self, engine: &mut Engine, optics: &Optics, worlds: &Worlds) {
        let steps = worlds.steps();
        if self.shapes != steps.len() {
            self.begin(engine, optics, worlds);
            return;
        }
        for there in &mut self.deforming {
            let Some(body) = steps[there.shape].body_of(there.object) else {
                continue;
            };
            if body.blend() != there.blend {
                there.blend = body.blend();
                let normals: Vec<f32> = pack::flat(body.smooth_normals()).collect();
                let at = u64::from(there.at) * size_of::<f32>() as u64;
                engine.write_at("look_values", at, bytemuck::cast_slice(&normals));
            }
        }
    }

    fn begin(&mut self, engine: &mut Engine, optics: &Optics, worlds: &Worlds) {
        let mut values: Vec<f32> = optics.lamps.iter().flat_map(lamp).collect();
        values.resize(LAMPS, 0.0);
        values.extend(tables::soft());
        let mut packer = Packer::new(values);
        packer.objects(worlds.steps());
        engine.write("looks", bytemuck::cast_slice(&packer.looks));
        engine.write("look_values", bytemuck::cast_slice(&packer.values));
        engine.write("texel_sums", bytemuck::cast_slice(&packer.sums));
        self.shapes = worlds.steps().len();
        self.deforming = packer.deforming;
    }
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
