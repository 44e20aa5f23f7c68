//! Materials and lamps in the layout of `materials.wgsl`, `material_values.wgsl` and
//! `texture.wgsl`.
//!
//! Everything is uploaded once, except for the smooth normals of deforming meshes, which the CPU
//! computes and uploads for each instant.

#[cfg(test)]
mod board_tests;
#[cfg(test)]
mod map_tests;
mod pack;
#[cfg(test)]
mod tests;

use super::Engine;
use crate::exposure::{Lamp, LampShape, Optics};
use crate::scene::Worlds;
use pack::{Deforming, Packer};

/// Number of values reserved for the lamps in front of the material values.
const LAMPS: usize = 32 * 8;

/// Materials of a scene on the GPU.
#[derive(Default)]
pub(crate) struct Materials {
    /// Number of shapes kept for each deforming mesh; 0 before the first upload.
    shapes: usize,
    deforming: Vec<Deforming>,
}

impl Materials {
    /// Uploads all materials and lamps, with meshes in their current shapes. Later calls upload only
    /// what has changed.
    pub(crate) fn update(&mut self, engine: &mut Engine, optics: &Optics, worlds: &Worlds) {
        let steps = worlds.steps();
        if self.shapes != steps.len() {
            self.begin(engine, optics, worlds);
            return;
        }
        for there in &mut self.deforming {
            let Some(instance) = steps[there.shape].instance_of(there.object) else {
                continue;
            };
            if instance.blend() != there.blend {
                there.blend = instance.blend();
                let normals: Vec<f32> = pack::flat(instance.smooth_normals()).collect();
                let at = u64::from(there.at) * size_of::<f32>() as u64;
                engine.write_at("material_values", at, bytemuck::cast_slice(&normals));
            }
        }
    }

    fn begin(&mut self, engine: &mut Engine, optics: &Optics, worlds: &Worlds) {
        let mut values: Vec<f32> = optics.lamps.iter().flat_map(lamp).collect();
        values.resize(LAMPS, 0.0);
        values.extend(pack::soft());
        let mut packer = Packer::new(values);
        packer.objects(worlds.steps());
        engine.write("materials", bytemuck::cast_slice(&packer.materials));
        engine.write("material_values", bytemuck::cast_slice(&packer.values));
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
