//! Skin on the GPU: uploads the tissues of a scene, and computes where the light seen at each point
//! entered the skin and how it spreads. Equivalent of the CPU's `exposure/skin_maps.rs` and
//! `transport/skin.rs`.

use super::{Commands, Engine, EntryPoint, grid};
use crate::Plan;
use crate::skin::{Component, MOST, Skins};
use bytemuck::{Pod, Zeroable};
use phasmid_core::error::Result;

/// Twin of `UnderSkin` in `skin_types.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
struct UnderSkin {
    origin: [f32; 2],
    px_per_mm: [f32; 2],
    tissue: u32,
    unused: u32,
}

/// Uploads the scene's tissues to the buffers `mixtures` and `skin_of`.
pub(crate) fn write(engine: &mut Engine, skins: &Skins) {
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

/// Computes light transport under skin at the centres of all pixels; fills `under_skin`.
///
/// # Errors
/// Returns an error if the GPU has failed.
pub(crate) fn run(
    engine: &mut Engine,
    commands: &mut Commands,
    plan: &Plan,
    pixels: usize,
) -> Result<()> {
    engine.reserve("under_skin", (pixels * size_of::<UnderSkin>()) as u64);
    engine.run(
        commands,
        &EntryPoint::new("skin_maps", "main", plan),
        grid(pixels),
    )
}

#[cfg(test)]
mod tests {
    use super::super::{engine, test_scene::TestScene};
    use super::*;
    use std::path::Path;

    const SKINS: &str = "ambient = { irradiance_w_m2 = 0.05 }\n\
        [[object]]\nshape = { kind = \"plane\" }\nposition_mm = [0, 0, 1000]\n\
        rotation_deg = [10, 35, 0]\nalbedo = 0.9\nskin = { fitzpatrick = 3 }\n\
        [[object]]\nshape = { kind = \"sphere\", radius_mm = 50.0 }\nposition_mm = [0, 0, 900]\n\
        albedo = 0.9\nskin = { absorption_per_mm = 0.02, reduced_scattering_per_mm = 2.0 }\n\
        [[object]]\nshape = { kind = \"sphere\", radius_mm = 30.0 }\nposition_mm = [80, 0, 850]\n\
        albedo = 0.5\n";

    fn close(found: &UnderSkin, place: [f32; 2], (px_per_mm, tissue): ([f32; 2], u16)) -> [f32; 2] {
        assert_eq!(found.tissue, u32::from(tissue));
        let mut off = [0.0f32; 2];
        for axis in 0..2 {
            // The GPU writes missing values as 0, not NaN.
            if place[axis].is_finite() {
                off[0] = off[0].max((found.origin[axis] - place[axis]).abs());
            }
            let spread = (found.px_per_mm[axis] - px_per_mm[axis]).abs();
            off[1] = off[1].max(spread / px_per_mm[axis].max(1e-3));
        }
        off
    }

    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn gpu_skin_transport_matches_the_cpu() {
        for distorted in [false, true] {
            let bench = TestScene::new(SKINS, Path::new(""), |profile| {
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
            let found: Vec<UnderSkin> =
                engine::words(&engine, "under_skin", pixels as u64).unwrap();
            let skin = bench.map.skin.as_ref().unwrap();
            let (mut place, mut spread, mut count) = (0.0f32, 0.0f32, [0; 2]);
            for (i, found) in found.iter().enumerate() {
                let at = skin.from.each_ref().map(|from| from[i]);
                let off = close(found, at, skin.at(i));
                (place, spread) = (place.max(off[0]), spread.max(off[1]));
                if let Some(count) = count.get_mut(found.tissue as usize) {
                    *count += 1;
                }
            }
            println!("{count:?} pixels; {place:.1e} px, {spread:.1e}");
            assert!(count[0] > 5000 && count[1] > 100);
            assert!(place < 3e-4 && spread < 1e-5);
        }
    }

    /// Returns the sixteen samples of a head.
    fn of_head(all: &[UnderSkin], head: usize) -> &[UnderSkin] {
        &all[16 * head..][..16]
    }

    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn gpu_skin_of_mixed_pixels_matches_the_cpu() {
        let bench = TestScene::new(SKINS, Path::new(""), |_| {});
        let mut engine = bench.engine();
        bench.see_mixed(&mut engine);
        let count = engine::words::<u32>(&engine, "mixed_count", 1).unwrap()[0] as usize;
        let heads: Vec<[u32; 4]> = engine::words(&engine, "mixed_heads", count as u64).unwrap();
        let all: Vec<UnderSkin> = engine::words(&engine, "mixed_skin", 16 * count as u64).unwrap();
        let (mut worst, mut samples, mut missing) = ([0.0f32; 2], 0, 0);
        for mixed in &bench.map.mixed {
            let Some(skin) = &mixed.skin else { continue };
            let Some(head) = heads.iter().position(|head| head[0] == mixed.pixel) else {
                missing += 1;
                continue;
            };
            for (k, found) in of_head(&all, head).iter().enumerate() {
                // At an edge, a sample may be lit on only one of CPU and GPU.
                if found.tissue != u32::from(skin.at(k).1) {
                    missing += 1;
                    continue;
                }
                let off = close(found, [mixed.x[k], mixed.y[k]], skin.at(k));
                worst = [worst[0].max(off[0]), worst[1].max(off[1])];
                samples += 1;
            }
        }
        println!("{samples} samples, {missing} others; {worst:?}");
        assert!(samples > 1000 && missing <= samples / 200);
        // At the rim of a ball, the normal changes noticeably within the rounding error of a ray.
        assert!(worst[0] < 1e-3 && worst[1] < 1e-4);
    }
}
