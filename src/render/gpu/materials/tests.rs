//! Compares the functions of the material shaders with the CPU's functions on many inputs, including
//! extreme ones.

use super::pack;
use crate::exposure::{Bell, Optics, Soft};
use crate::gpu::{self, Engine};
use crate::material::{Ggx, Lay, Texture};
use crate::scene::Shaded;
use glam::{DVec2, DVec3, Vec2, Vec3, Vec3Swizzles};
use phasmid_profile::{Focus, Profile, Scene, Vignetting};
use std::f32::consts::TAU;

/// Pseudo-random numbers in [0, 1) (scrambled Weyl sequence).
struct Dice(u64);

impl Dice {
    fn new() -> Self {
        Self(0)
    }

    fn roll(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (mixed >> 40) as f32 / (1u32 << 24) as f32
    }

    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.roll()
    }

    /// Returns a random size between `low` and `high` whose logarithm is uniformly distributed.
    fn size(&mut self, low: f32, high: f32) -> f32 {
        low * (high / low).powf(self.roll())
    }

    fn direction(&mut self, cos: f32) -> Vec3 {
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let turn = self.between(0.0, TAU);
        Vec3::new(sin * turn.cos(), sin * turn.sin(), cos).normalize()
    }
}

fn bits(values: &[f32]) -> impl Iterator<Item = u32> {
    values.iter().map(|v| v.to_bits())
}

fn floats(words: &[u32]) -> Vec<f32> {
    words.iter().map(|&w| f32::from_bits(w)).collect()
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_materials_reflect_as_on_the_cpu() {
    let materials: Vec<Ggx> = [
        (0.0, 0.05),
        (1.0, 0.05),
        (0.04, 0.2),
        (0.04, 0.5),
        (0.3, 0.35),
        (0.04, 1.0),
        (1.0, 1.0),
    ]
    .map(|(f0, roughness)| Ggx::new(f0, roughness))
    .into();
    let mut values = Vec::new();
    let places: Vec<u32> = materials
        .iter()
        .map(|ggx| {
            let at = values.len() as u32;
            values.extend(pack::lobe(ggx));
            at
        })
        .collect();
    let mut dice = Dice::new();
    let mut cases = Vec::new();
    for (material, _) in materials.iter().enumerate() {
        for k in 0..3000 {
            let cos = |dice: &mut Dice| match k % 5 {
                0 => dice.size(1e-6, 1.0),
                1 => -dice.roll(),
                2 => 1.0 - dice.size(1e-7, 1.0),
                _ => dice.roll(),
            };
            let (light, mut view) = {
                let (a, b) = (cos(&mut dice), cos(&mut dice));
                (dice.direction(a), dice.direction(b))
            };
            if k % 7 == 0 {
                // The view is in the highlight or next to it.
                let aside = dice.direction(0.0) * dice.size(1e-6, 1e-1);
                view = (Vec3::new(-light.x, -light.y, light.z) + aside).normalize();
            }
            let albedo = [0.0, 1.0, dice.roll()][k % 3];
            cases.push((material, albedo, light, view));
        }
    }
    // The normal is not along an axis.
    let turn = glam::Quat::from_euler(glam::EulerRot::XYZ, 0.3, -0.9, 0.5);
    let normal = (turn * Vec3::Z).normalize();
    for (_, _, light, view) in &mut cases {
        (*light, *view) = ((turn * *light).normalize(), (turn * *view).normalize());
    }
    let mut input = Vec::new();
    for &(material, albedo, light, view) in &cases {
        input.push(places[material]);
        input.push(albedo.to_bits());
        for v in [normal, light, view] {
            input.extend(bits(&v.to_array()));
        }
    }
    let mut engine = Engine::for_tests();
    engine.write("material_values", bytemuck::cast_slice(&values));
    let output = engine.call("tests/ggx_test", &input, 2 * cases.len(), cases.len());
    let (mut worst, mut worst_even) = (0.0f64, 0.0f64);
    for (case, found) in cases.iter().zip(floats(&output).chunks(2)) {
        let (material, albedo, light, view) = *case;
        let ggx = &materials[material];
        let [n, l, v] = [normal, light, view].map(Vec3::as_dvec3);
        let exact = ggx.reflectance(albedo.into(), n, l, v);
        let even = ggx.under_even_light(albedo.into(), n.dot(v));
        // Error of the visible radiance, relative where the radiance is high: smooth surfaces reach
        // a radiance of a thousand.
        let scale = n.dot(l).max(0.0);
        let error = (f64::from(found[0]) - exact).abs() * scale / (1.0 + exact * scale);
        if error > worst {
            println!("{case:?}: {} for {exact}: {error:.1e}", found[0]);
            worst = error;
        }
        worst_even = worst_even.max((f64::from(found[1]) - even).abs());
    }
    println!("from one direction {worst:.1e}, from all {worst_even:.1e}");
    assert!(worst < 3e-4, "{worst}");
    assert!(worst_even < 3e-6, "{worst_even}");
}

fn textures(dice: &mut Dice) -> Vec<Texture> {
    let mut noise = |width: usize, height: usize| {
        let texels: Vec<f64> = (0..width * height).map(|_| dice.roll().into()).collect();
        Texture::new(width, height, texels.into_iter())
    };
    let mut textures = vec![noise(1, 1), noise(37, 23), noise(5, 300), noise(1024, 700)];
    textures.push(Texture::new(
        16,
        16,
        (0..256).map(|k| f64::from((k % 16 + k / 16) % 2)),
    ));
    textures.push(Texture::new(
        4096,
        64,
        (0..4096 * 64).map(|k| f64::from(k / 7 % 2)),
    ));
    textures
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_textures_are_averaged_as_on_the_cpu() {
    let mut dice = Dice::new();
    let textures = textures(&mut dice);
    let mut sums: Vec<[u32; 2]> = Vec::new();
    let places: Vec<u32> = textures
        .iter()
        .map(|texture| {
            let at = sums.len() as u32;
            sums.extend(pack::sums(texture));
            at
        })
        .collect();
    let mut cases: Vec<(usize, Vec2, Vec2, Vec2, bool)> = Vec::new();
    for (t, texture) in textures.iter().enumerate() {
        let size = Vec2::new(texture.width as f32, texture.height as f32);
        for k in 0..4000 {
            let near = |dice: &mut Dice| match k % 8 {
                // Positions on borders of texels and of the texture.
                0 => Vec2::new(dice.between(-3.0, 3.0).round(), dice.roll()),
                1 => (size * Vec2::new(dice.roll(), dice.roll())).round() / size,
                2 => Vec2::ZERO,
                _ => Vec2::new(dice.between(-2.0, 2.0), dice.between(-2.0, 2.0)),
            };
            let uv = near(&mut dice);
            let (a, b) = match k % 3 {
                0 => (dice.size(0.1, 10.0), dice.size(0.1, 10.0)),
                1 => (dice.size(1e-4, 1.0), dice.size(0.1, 100.0)),
                _ => (dice.size(1e-4, 1e5), dice.size(1e-4, 1e5)),
            };
            let slanted = k % 2 == 0;
            let turn = match slanted {
                true => Vec2::from_angle(dice.between(0.0, TAU)),
                false => Vec2::X,
            };
            let across = turn.rotate(Vec2::new(a, 0.0)) / size;
            let skew = if slanted { 0.3 * a } else { 0.0 };
            let down = turn.rotate(Vec2::new(skew, -b)) / size;
            cases.push((t, uv, across, down, slanted));
        }
    }
    let mut input = Vec::new();
    for &(t, uv, across, down, _) in &cases {
        let texture = &textures[t];
        input.extend([places[t], texture.width as u32, texture.height as u32]);
        input.push(pack::mean(texture).to_bits());
        for v in [uv, across, down] {
            input.extend(bits(&v.to_array()));
        }
    }
    let mut engine = Engine::for_tests();
    engine.write("texel_sums", bytemuck::cast_slice(&sums));
    let output = engine.call("tests/texture_test", &input, cases.len(), cases.len());
    let (mut worst, mut off) = ([0.0f64; 2], 0);
    for (case, found) in cases.iter().zip(floats(&output)) {
        let &(t, uv, across, down, slanted) = case;
        let [uv, across, down] = [uv, across, down].map(Vec2::as_dvec2);
        let exact = textures[t].average(uv, across, down);
        let error = (f64::from(found) - exact).abs();
        // If a texel border lies within the rounding error of the position, a narrow footprint may
        // see the texel on either side.
        let size = DVec2::new(textures[t].width as f64, textures[t].height as f64);
        let extent = (across.abs() + down.abs()) * size;
        let bar = 1e-5 + 6e-7 * size.max_element() / extent.min_element().max(1e-3);
        if error > bar {
            off += 1;
            println!("{case:?}: {found} for {exact}, bar {bar:.1e}");
        } else {
            let worst = &mut worst[usize::from(slanted)];
            *worst = worst.max(error / bar);
        }
    }
    println!(
        "worst error / limit: straight footprints {:.2}, slanted ones {:.2}; {off} above the limit",
        worst[0], worst[1]
    );
    // CPU and GPU differ only where rounding decides the number of pieces.
    assert!(off <= cases.len() / 5000, "{off} of {}", cases.len());
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_borders_are_as_soft_as_on_the_cpu() {
    let mut dice = Dice::new();
    let bell = Bell::new();
    let mut cases: Vec<([f32; 2], f32, f32)> = Vec::new();
    for k in 0..20000 {
        let sigma = dice.size(1e-3, 1e3);
        let slope = [0, 1].map(|i| match (k + i) % 5 {
            0 => 0.0,
            1 => -dice.size(1e-6, 1e3),
            2 => sigma * dice.size(1e-4, 10.0),
            _ => dice.size(1e-3, 10.0),
        });
        let reach = 6.5 * sigma + slope[0].abs() + slope[1].abs();
        let e = match k % 7 {
            0 => 0.0,
            1 => sigma * dice.between(-0.01, 0.01),
            _ => reach * dice.between(-1.0, 1.0),
        };
        cases.push((slope, sigma, e));
    }
    let mut values = vec![0.0f32; super::LAMPS];
    values.extend(pack::soft());
    let input: Vec<u32> = cases
        .iter()
        .flat_map(|&(slope, sigma, e)| [slope[0], slope[1], sigma, e].map(f32::to_bits))
        .collect();
    let mut engine = Engine::for_tests();
    engine.write("material_values", bytemuck::cast_slice(&values));
    let output = engine.call("tests/soft_test", &input, 2 * cases.len(), cases.len());
    let mut worst = [0.0f64; 2];
    for (case, found) in cases.iter().zip(floats(&output).chunks(2)) {
        let &(slope, sigma, e) = case;
        let soft = Soft::new(&bell, slope.map(f64::from), sigma.into());
        let exact = [soft.left_of(e.into()), soft.sharp_left_of(e.into())];
        for i in 0..2 {
            let error = (f64::from(found[i]) - exact[i]).abs();
            if error > worst[i] {
                println!("{i} {case:?}: {} for {}", found[i], exact[i]);
                worst[i] = error;
            }
        }
    }
    println!("soft {:.1e}, sharp {:.1e}", worst[0], worst[1]);
    assert!(worst[0] < 1e-4 && worst[1] < 1e-4, "{worst:?}");
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_images_lie_as_on_the_cpu() {
    let mut dice = Dice::new();
    let mut cases: Vec<(Lay, [Vec3; 4])> = Vec::new();
    for k in 0..6000 {
        let lay = [Lay::Along, Lay::Sphere, Lay::Cylinder][k % 3];
        let cos = match k % 5 {
            0 => 1.0 - dice.size(1e-9, 1e-3),
            1 => 0.0,
            _ => dice.between(-1.0, 1.0),
        };
        let radius = dice.size(0.1, 2000.0);
        // The axis of the shape is y.
        let p = dice.direction(cos).xzy() * radius;
        let up = dice.between(-1.0, 1.0);
        let mut normal = dice.direction(up);
        if k % 2 == 0 {
            normal = Vec3::new(p.x, 0.0, p.z).normalize_or(Vec3::Y);
        }
        let across = dice.direction(0.3) * dice.size(1e-2, 1.0);
        let down = dice.direction(-0.4) * dice.size(1e-2, 1.0);
        cases.push((lay, [p, normal, across, down]));
    }
    let mut input = Vec::new();
    for (lay, vectors) in &cases {
        input.push(pack::number(*lay));
        input.extend(vectors.iter().flat_map(|v| v.to_array()).map(f32::to_bits));
    }
    let mut engine = Engine::for_tests();
    let output = engine.call("tests/laid_test", &input, 6 * cases.len(), cases.len());
    let (mut worst, mut worst_side) = (0.0f64, 0.0f64);
    for (case, found) in cases.iter().zip(floats(&output).chunks(6)) {
        let (lay, [p, normal, across, down]) = case;
        let [p, normal, across, down] = [p, normal, across, down].map(|v| v.as_dvec3());
        let laid = lay.at(p, normal);
        let mut off = DVec2::new(found[0].into(), found[1].into()) - laid.at;
        if !matches!(lay, Lay::Along) {
            // Angles wrap around, and on the axis any angle is valid.
            let ring = p.x.hypot(p.z);
            let radius = if matches!(lay, Lay::Sphere) {
                p.length()
            } else {
                ring
            };
            let turn = radius * std::f64::consts::TAU;
            off.x -= (off.x / turn).round() * turn;
            off.x *= f64::from(u8::from(ring > 1e-6 * p.length()));
        }
        let error = off.abs().max_element() / p.length();
        if error > worst {
            println!("{case:?}: {found:?} for {:?}", laid.at);
            worst = error;
        }
        for (side, at) in [(across, 2), (down, 4)] {
            let exact = laid.gradient.map(|g: DVec3| g.dot(side));
            // A gradient is steep close to the axis, so its error is relative.
            let scale = laid.gradient.map(|g| g.length());
            for i in 0..2 {
                let error = (f64::from(found[at + i]) - exact[i]).abs();
                worst_side = worst_side.max(error / (scale[i] * side.length()));
            }
        }
    }
    println!("of the radius {worst:.1e}; sides {worst_side:.1e}");
    assert!(worst < 1e-6 && worst_side < 1e-5, "{worst} {worst_side}");
}

/// GPU and CPU agree for lenses with vignetting and for a projector with a finite depth of focus.
#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_lenses_dim_as_on_the_cpu() {
    let mut profile = Profile::load("pmp-bench").unwrap();
    profile.camera.vignetting = Vignetting {
        natural: true,
        falloff: [-0.3, 0.1, -0.05],
    };
    profile.projector.vignetting = Vignetting {
        natural: true,
        falloff: [0.2, -0.4, 0.1],
    };
    profile.projector.focus = Some(Focus {
        distance_mm: 950.0,
        aperture_mm: 12.0,
    });
    let optics = Optics::new(&profile, &Scene::load("plane").unwrap());
    let (width, height) = (profile.projector.width_px, profile.projector.height_px);
    let view = profile.projector.view();
    let mut dice = Dice::new();
    let cases: Vec<[f32; 11]> = (0..16 * 1000)
        .map(|k| {
            let far = dice.size(1e-3, 2.0);
            let ideal = Vec2::from_angle(dice.between(0.0, TAU)) * far;
            let z = match k % 4 {
                // Depths in focus and close to it.
                0 => 950.0 + dice.between(-1.0, 1.0),
                1 => dice.size(1.0, 1e5),
                _ => dice.between(600.0, 1500.0),
            };
            let there = view.center() + view.rig_from_view.rotation.z_axis * f64::from(z);
            let [x, y, z] = there.as_vec3().to_array();
            let side = |dice: &mut Dice, size: u32| match k % 3 {
                0 => dice.between(-0.5, 3.0),
                1 => size as f32 - 0.5 - dice.size(1e-3, 100.0),
                _ => dice.between(-0.5, size as f32 - 0.5),
            };
            let px = [side(&mut dice, width), side(&mut dice, height)];
            let slope = [0; 4].map(|_| dice.size(1e-3, 10.0) - 0.1);
            [
                ideal.x, ideal.y, x, y, z, px[0], px[1], slope[0], slope[1], slope[2], slope[3],
            ]
        })
        .collect();
    let mut values = vec![0.0f32; super::LAMPS];
    values.extend(pack::soft());
    let mut engine = Engine::for_tests();
    engine.write("material_values", bytemuck::cast_slice(&values));
    gpu::optics::write(&mut engine, &optics);
    let input: Vec<u32> = bits(cases.as_flattened()).collect();
    let output = engine.call("tests/falloff_test", &input, 4 * cases.len(), cases.len());
    let mut worst = [0.0f64; 4];
    for (cases, found) in cases.chunks(16).zip(floats(&output).chunks(64)) {
        let at = |i: usize| -> [f64; 16] { std::array::from_fn(|lane| cases[lane][i].into()) };
        let mut shaded = Shaded {
            point: [at(2), at(3), at(4)],
            px: [at(5), at(6)],
            footprint: [[at(7), at(8)], [at(9), at(10)]],
            projected: [1.0; 16],
            ambient: [0.0; 16],
            flickering: [0.0; 16],
            evenly: [0.0; 16],
            lamps: [0; 16],
            reachable: [true; 16],
            square: [true; 16],
        };
        optics.defocus.dim_border(&mut shaded);
        for lane in 0..16 {
            let ideal = DVec2::new(at(0)[lane], at(1)[lane]);
            let point = DVec3::new(at(2)[lane], at(3)[lane], at(4)[lane]);
            let exact = [
                optics.seen.at(ideal),
                optics.shown.at(ideal),
                optics.defocus.sigma_px(point),
                shaded.projected[lane],
            ];
            for i in 0..4 {
                let error = (f64::from(found[4 * lane + i]) - exact[i]).abs();
                // Where the blur is wide, its error is relative.
                worst[i] = worst[i].max(error / (1.0 + exact[i]));
            }
        }
    }
    println!("camera, projector, blur, border: {worst:?}");
    assert!(worst[0] < 2e-6 && worst[1] < 2e-6, "{worst:?}");
    assert!(worst[2] < 1e-5 && worst[3] < 1e-4, "{worst:?}");
}
