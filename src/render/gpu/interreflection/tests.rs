//! Compares indirect light on the GPU with indirect light on the CPU.

use super::super::test_scene::TestScene;
use super::super::{Engine, engine};
use super::{Params, Point, disc};
use crate::transport::interreflection::Hemisphere;
use glam::{DVec2, DVec3, Vec3};
use phasmid_geometry::{Mesh, ply};
use std::f64::consts::TAU;
use std::path::Path;

/// Scene with a box around a ball, in front of a wall and under a lamp.
const CLUTTER: &str = "interreflection = { samples = 64, step_px = 4 }\n\
    ambient = { irradiance_w_m2 = 0.02 }\n\
    [[light]]\nkind = \"point\"\nposition_mm = [-300, 200, 400]\nintensity_w_sr = 0.04\n\
    flicker = { frequency_hz = 100, depth = 0.4 }\n\
    [[light]]\nkind = \"directional\"\ndirection = [0.3, 0.2, 1]\nirradiance_w_m2 = 0.3\n\
    [[object]]\nshape = { kind = \"plane\", size_mm = [300, 20000] }\n\
    position_mm = [-106.066, 0, 943.934]\nrotation_deg = [0, -45, 0]\nalbedo = 0.8\n\
    [[object]]\nshape = { kind = \"plane\", size_mm = [200, 20000] }\n\
    position_mm = [70.711, 0, 979.289]\nrotation_deg = [0, 45, 0]\nalbedo = 0.6\n\
    [[object]]\nshape = { kind = \"sphere\", radius_mm = 60.0 }\n\
    position_mm = [0, 0, 940]\nalbedo = 0.8\nspecular = { f0 = 0.05, roughness = 0.5 }\n";

/// Writes a folded sheet whose folds light each other to a file in `folder`.
fn folds(folder: &Path) -> String {
    let mut mesh = Mesh::default();
    let count = 12;
    for k in 0..=count {
        let x = 400.0 * (f64::from(k) / f64::from(count) - 0.5);
        let z = 960.0 + 40.0 * f64::from(k % 2);
        let half = DVec3::Y * 150.0;
        let middle = DVec3::new(x, 0.0, z);
        mesh.vertices.extend([middle - half, middle + half]);
    }
    for k in (0..2 * count).step_by(2) {
        mesh.triangles
            .extend([[k, k + 1, k + 2], [k + 1, k + 3, k + 2]]);
    }
    ply::write_mesh(&folder.join("folds.ply"), &mesh).unwrap();
    "interreflection = { samples = 48, step_px = 3 }\nambient = { irradiance_w_m2 = 0.02 }\n\
     [[light]]\nkind = \"point\"\nposition_mm = [-300, 200, 400]\nintensity_w_sr = 0.04\n\
     [[object]]\nshape = { kind = \"mesh\", file = \"folds.ply\" }\nalbedo = 0.6\n"
        .to_owned()
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn pixels_are_interpolated_from_the_points_that_the_cpu_takes() {
    let mut bench = TestScene::new(CLUTTER, Path::new(""), |_| {});
    let (wanted, size) = (bench.wanted.unwrap(), bench.size());
    let cpu = bench.bounced().interreflection;
    let mut engine = bench.engine();
    let params = Params::new(wanted, size);
    super::shares(&mut engine, &params, &bench.plan).unwrap();
    let pixels = cpu.first.len() as u64;
    let points = engine::words::<u32>(&engine, "interreflection_count", 1).unwrap()[0];
    let first: Vec<u32> = engine::words(&engine, "interreflection_first", pixels).unwrap();
    let shares: Vec<[f32; 4]> = engine::words(&engine, "interreflection_shares", pixels).unwrap();
    let (mut differ, mut worst, mut alone) = (0, 0.0f32, Vec::new());
    for i in 0..first.len() {
        let [a, b] = [cpu.first[i], first[i]].map(|f| f.min(params.on_grid()));
        let scale = bench.map.evenly[i].max(1e-30);
        let off = (0..4).map(|k| (cpu.shares[i][k] - shares[i][k]).abs() / scale);
        let off = off.fold(0.0, f32::max);
        // Rounding may decide whether a gather point lies on the same surface as the pixel.
        if a != b || off > 1e-3 {
            differ += 1;
        } else {
            worst = worst.max(off);
        }
        if first[i] >= params.on_grid() {
            alone.push(first[i]);
        }
    }
    println!(
        "{differ} of {}, {} alone; {worst:.1e}",
        first.len(),
        alone.len()
    );
    assert!(differ <= first.len() / 10_000 && worst < 1e-5);
    // The points outside the grid are exactly the pixels that cannot be interpolated, each once.
    alone.sort_unstable();
    assert!(alone.iter().copied().eq(params.on_grid()..points));
    assert!(alone.len() > 10);
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_directions_match_the_cpu() {
    let mut engine = Engine::for_tests();
    let samples = 64;
    engine.write("interreflection_disc", bytemuck::cast_slice(&disc(samples)));
    let count = 6400;
    let at = |i: u32| {
        let z = 1.0 - (2.0 * f64::from(i / samples) + 1.0) / 100.0;
        let (sin, cos) = (f64::from(i / samples) * 2.4).sin_cos();
        let across = (1.0 - z * z).sqrt();
        DVec3::new(across * cos, across * sin, z).as_vec3()
    };
    let turn = |i: u32| (i / samples).wrapping_mul(2_654_435_769);
    let input: Vec<u32> = (0..count)
        .flat_map(|i| {
            let n = at(i).to_array().map(f32::to_bits);
            [n[0], n[1], n[2], turn(i)]
        })
        .collect();
    let found = engine.call(
        "tests/hemisphere_test",
        &input,
        12 * count as usize,
        count as usize,
    );
    let found: Vec<f32> = found.into_iter().map(f32::from_bits).collect();
    let hemisphere = Hemisphere::new(samples as usize);
    let (mut worst, mut sides) = (0.0f64, 0.0f64);
    for point in 0..count / samples {
        let angle = f64::from(turn(point * samples)) / 4_294_967_296.0 * TAU;
        let normal = at(point * samples).as_dvec3().normalize();
        let above = hemisphere.above(normal, angle).flatten();
        for (k, ray) in above.enumerate() {
            let words = &found[(point as usize * samples as usize + k) * 12..][..12];
            let v = |k: usize| Vec3::from_slice(&words[4 * k..]).as_dvec3();
            worst = worst.max((v(0) - ray.direction).length());
            let turned = DVec2::new(words[3].into(), words[7].into());
            worst = worst.max((turned - DVec2::from_angle(angle)).length());
            for side in 0..2 {
                let size = ray.sides[side].length();
                sides = sides.max((v(1 + side) - ray.sides[side]).length() / size);
            }
        }
    }
    println!("{worst:.1e}, sides {sides:.1e}");
    assert!(worst < 6e-7 && sides < 1e-6);
}

/// Returns the median, the 99 % and 99.9 % quantiles, and the maximum.
fn spread(mut values: Vec<f32>) -> [f32; 4] {
    values.sort_by(f32::total_cmp);
    let last = (values.len() - 1) as f64;
    [0.5, 0.99, 0.999, 1.0].map(|part| values[(last * part) as usize])
}

/// Compares the indirect light of full white and of lamps at all pixels in W/m^2, and the rays of
/// grid points one by one.
fn check(name: &str, bench: &mut TestScene) {
    let (wanted, size, plan) = (bench.wanted.unwrap(), bench.size(), bench.plan);
    let map = bench.bounced();
    let mut engine = bench.engine();
    engine.write("mixed_count", &[0; 16]);
    engine.write("mixed_heads", &[0; 16]);
    super::run(&mut engine, wanted, &plan, size).unwrap();
    let pixels = map.x.len() as u64;
    let params = Params::new(wanted, size);
    let count = engine::words::<u32>(&engine, "interreflection_count", 1).unwrap()[0];
    let points: Vec<Point> =
        engine::words(&engine, "interreflection_points", count.into()).unwrap();
    let first: Vec<u32> = engine::words(&engine, "interreflection_first", pixels).unwrap();
    let shares: Vec<[f32; 4]> = engine::words(&engine, "interreflection_shares", pixels).unwrap();
    let light: Vec<[f32; 2]> = engine::words(&engine, "light", pixels).unwrap();
    let flickering: Vec<f32> = engine::words(&engine, "flickering", pixels).unwrap();
    let columns = params.places[0] as usize;
    let white = |pixel: usize| -> f32 {
        let first = first[pixel] as usize;
        let corners = [first, first + 1, first + columns, first + columns + 1];
        let given = (0..4).filter(|&k| shares[pixel][k] > 0.0);
        given
            .map(|k| shares[pixel][k] * points[corners[k]].white)
            .sum()
    };
    let mut padded = map.interreflection.white.clone();
    padded.resize(map.interreflection.padded(), 0.0);
    let most = padded.iter().fold(0.0f32, |m, &w| m.max(w));
    let seen: Vec<usize> = (0..map.x.len())
        .filter(|&i| bench.map.evenly[i] > 0.0)
        .collect();
    let of = |off: &dyn Fn(usize) -> f32| {
        spread(
            seen.iter()
                .map(|&i| off(i).abs() / bench.map.evenly[i])
                .collect(),
        )
    };
    let by_white = of(&|i| map.interreflection.at(i, &padded) - white(i));
    let by_lamps = of(&|i| map.ambient[i] - light[i][1]);
    println!("{name}: {most:.2} W/m^2 at most; white {by_white:?}, lamps {by_lamps:?}");
    // One of several dozen rays may hit the other side of an edge.
    for off in [by_white, by_lamps] {
        assert!(
            off[0] < 1e-6 * most && off[1] < 1e-4 * most,
            "{name}: {off:?}"
        );
        assert!(
            off[2] < 0.02 * most && off[3] < 0.1 * most,
            "{name}: {off:?}"
        );
    }
    if !map.flickering.is_empty() {
        let swing = of(&|i| map.flickering[i] - flickering[i]);
        assert!(
            swing[1] < 1e-4 * most && swing[3] < 0.1 * most,
            "{name}: {swing:?}"
        );
    }
    // Compares the rays of the grid points, which CPU and GPU number identically.
    let (mut rays, mut same, mut worst, mut before) = (0, 0, [0.0f32; 3], 0);
    let x: Vec<[f32; 4]> = ray_words(&engine, "interreflection_x", count, wanted.samples);
    let y: Vec<[f32; 4]> = ray_words(&engine, "interreflection_y", count, wanted.samples);
    for i in 0..params.on_grid() as usize {
        let end = map.interreflection.ends[i] as usize;
        let mut own = Vec::new();
        for block in before..end {
            let b = &map.interreflection;
            own.extend(
                (0..8)
                    .filter(|&k| b.weight[block][k] > 0.0)
                    .map(|k| (block, k)),
            );
        }
        before = end;
        let point = points[i];
        rays += own.len();
        if point.kept as usize != own.len() {
            continue;
        }
        for (k, &(block, lane)) in own.iter().enumerate() {
            let b = &map.interreflection;
            let there = [&x, &y].map(|rays| rays[point.first as usize + k]);
            let slope = [b.x_slope[block][lane], b.y_slope[block][lane]];
            let at = [b.x[block][lane], b.y[block][lane]];
            same += 1;
            for axis in 0..2 {
                let size = slope[axis][0].abs() + slope[axis][1].abs() + 1.0;
                worst[0] = worst[0].max((there[axis][0] - at[axis]).abs() / size);
                for side in 0..2 {
                    let off = (there[axis][1 + side] - slope[axis][side]).abs() / size;
                    worst[1] = worst[1].max(off);
                }
                let weight = b.weight[block][lane];
                worst[2] = worst[2].max((there[axis][3] - weight).abs() / weight);
            }
        }
    }
    println!("{name}: {same} of {rays} rays; place, sides, weight {worst:?}");
    assert!(same as f64 > 0.98 * rays as f64 && rays > 1000);
}

fn ray_words(engine: &Engine, name: &str, points: u32, samples: u32) -> Vec<[f32; 4]> {
    engine::words(engine, name, u64::from(points) * u64::from(samples)).unwrap()
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_interreflection_matches_the_cpu() {
    check(
        "clutter",
        &mut TestScene::new(CLUTTER, Path::new(""), |_| {}),
    );
    let mut bent = TestScene::new(CLUTTER, Path::new(""), |profile| {
        profile.projector.distortion = [-0.05, 0.02, -4e-4, 6e-4, 0.001];
        profile.projector.vignetting.natural = true;
        profile.projector.focus = Some(phasmid_profile::Focus {
            distance_mm: 850.0,
            aperture_mm: 6.0,
        });
    });
    check("soft, bent and dim", &mut bent);
    let folder = tempfile::tempdir().unwrap();
    let lines = folds(folder.path());
    check("folds", &mut TestScene::new(&lines, folder.path(), |_| {}));
}
