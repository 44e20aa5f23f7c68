//! Skin on the GPU: the tissues of a scene, where light comes from and how far it spreads. Twin of
//! `skin/maps.rs`.

use super::{Commands, Engine, Stage, grid};
use crate::emulator::render::Plan;
use crate::emulator::render::skin::{Component, MOST, Skins};
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
    engine.run(
        commands,
        &Stage::new("skin_maps", "main", plan),
        grid(pixels),
    )
}

#[cfg(test)]
mod tests {
    use super::super::{bench::Bench, maps};
    use super::*;
    use std::path::Path;

    const SKINS: &str = "ambient = { irradiance_w_m2 = 0.05 }\n\
        [[object]]\nshape = { kind = \"plane\" }\nposition_mm = [0, 0, 1000]\n\
        rotation_deg = [10, 35, 0]\nalbedo = 0.9\nskin = { fitzpatrick = 3 }\n\
        [[object]]\nshape = { kind = \"sphere\", radius_mm = 50.0 }\nposition_mm = [0, 0, 900]\n\
        albedo = 0.9\nskin = { absorption_per_mm = 0.02, reduced_scattering_per_mm = 2.0 }\n\
        [[object]]\nshape = { kind = \"sphere\", radius_mm = 30.0 }\nposition_mm = [80, 0, 850]\n\
        albedo = 0.5\n";

    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn light_travels_under_skin_as_on_the_cpu() {
        for distorted in [false, true] {
            let bench = Bench::new(SKINS, Path::new(""), |profile| {
                if distorted {
                    profile.camera.distortion = [-0.12, 0.05, 8e-4, -5e-4, -0.004];
                    profile.projector.distortion = [-0.05, 0.02, -4e-4, 6e-4, 0.001];
                }
            });
            let mut engine = bench.engine();
            let mut commands = engine.commands();
            let pixels = bench.map.x.len();
            run(&mut engine, &mut commands, &bench.plan, pixels).unwrap();
            engine.submit(commands);
            let found: Vec<UnderSkin> = maps::words(&engine, "under_skin", pixels as u64).unwrap();
            let skin = bench.map.skin.as_ref().unwrap();
            let (mut place, mut spread, mut count) = (0.0f32, 0.0f32, [0; 2]);
            for (i, found) in found.iter().enumerate() {
                let (px_per_mm, tissue) = skin.at(i);
                assert_eq!(found.tissue, u32::from(tissue), "{i}");
                if let Some(count) = count.get_mut(usize::from(tissue)) {
                    *count += 1;
                }
                for axis in 0..2 {
                    if skin.from[axis][i].is_finite() {
                        place = place.max((found.origin[axis] - skin.from[axis][i]).abs());
                    }
                    let off = (found.px_per_mm[axis] - px_per_mm[axis]).abs();
                    spread = spread.max(off / px_per_mm[axis].max(1e-3));
                }
            }
            println!("{count:?} pixels; {place:.1e} px, {spread:.1e}");
            assert!(count[0] > 10_000 && count[1] > 500);
            assert!(place < 3e-4 && spread < 1e-5);
        }
    }
}
