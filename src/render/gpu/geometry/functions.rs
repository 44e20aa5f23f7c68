//! Compares the shaders' functions for lenses, solids and rays with the CPU's functions.

use super::super::{Engine, optics};
use super::tests::{Case, SOLIDS, moving, small};
use crate::scene::{Surface, World};
use glam::{DVec2, DVec3};
use phasmid_geometry::raycast::{LANES, Scratch};
use phasmid_geometry::{Lens, Solid};
use phasmid_profile::{Profile, Scene};

fn f(word: u32) -> f64 {
    f64::from(f32::from_bits(word))
}

fn words(v: DVec3) -> [u32; 3] {
    v.as_vec3().to_array().map(f32::to_bits)
}

/// Points evenly distributed over the unit sphere (Vogel's spiral).
fn direction(i: usize, count: usize) -> DVec3 {
    let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
    let (sin, cos) = (i as f64 * 2.399_963_229_728_653).sin_cos();
    let r = (1.0 - z * z).sqrt();
    DVec3::new(r * cos, r * sin, z)
}

fn lens_off(engine: &mut Engine, profile: &Profile) {
    let scene = Scene::load("plane").unwrap();
    let case = Case::new(profile.clone(), &scene);
    optics::write(engine, &case.optics);
    let (camera, projector) = (&case.optics.camera.lens, &case.optics.projector.lens);
    let pixels: Vec<DVec2> = (0..4000)
        .map(|i| {
            let size = DVec2::new(f64::from(camera.width_px), f64::from(camera.height_px));
            (direction(i, 4000).truncate() * 0.5 + 0.5) * size
        })
        .map(|px| px.as_vec2().as_dvec2())
        .collect();
    let input: Vec<u32> = pixels
        .iter()
        .flat_map(|px| px.as_vec2().to_array().map(f32::to_bits))
        .collect();
    let output = engine.call("tests/lens_test", &input, 12 * pixels.len(), pixels.len());
    let (mut ray_off, mut px_off): (f64, f64) = (0.0, 0.0);
    for (px, out) in pixels.iter().zip(output.chunks(12)) {
        let ray = camera.ray(*px).truncate();
        ray_off = ray_off.max((ray - DVec2::new(f(out[0]), f(out[1]))).length());
        px_off = px_off.max((*px - DVec2::new(f(out[2]), f(out[3]))).length());
        let jacobian = camera.distort_jacobian(ray).to_cols_array();
        for (wanted, &found) in jacobian.iter().zip(&out[4..8]) {
            assert!((wanted - f(found)).abs() < 3e-6, "{px}");
        }
        let shown = |lens: &Lens| lens.place(ray * 2.0);
        assert_eq!(shown(projector).is_none(), out[10] == 1, "{px}");
        if let Some(shown) = shown(projector) {
            let off = (shown - DVec2::new(f(out[8]), f(out[9]))).length();
            assert!(off < 2e-6 * shown.length().max(2000.0), "{px}: {off}");
        }
        assert_eq!(out[11], 0);
    }
    println!(
        "{}: rays off by {ray_off:.1e}, pixels there and back by {px_off:.1e}",
        profile.name
    );
    assert!(ray_off < 3e-7 && px_off < 5e-4);
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_lenses_match_the_cpu() {
    let mut engine = Engine::for_tests();
    for name in ["pmp-bench", "pmp-real"] {
        let mut profile = Profile::load(name).unwrap();
        lens_off(&mut engine, &profile);
        profile.camera.distortion = [-0.21, 0.08, 1.2e-3, -7e-4, -0.011];
        // This distortion folds over at a tangent of one.
        profile.projector.distortion = [-0.3333, 0.0, 0.0, 0.0, 0.0];
        lens_off(&mut engine, &profile);
    }
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_solids_match_the_cpu() {
    let solids = [
        Solid::Plane {
            half: DVec2::new(60.0, 1e30),
        },
        Solid::Sphere { radius: 50.0 },
        Solid::Cylinder {
            radius: 40.0,
            half_length: 70.0,
        },
        Solid::frustum(120.0, 50.0, 60.0),
    ];
    let mut rays = Vec::new();
    for i in 0..20_000 {
        let distance = [900.0, 150.0, 20.0][i % 3];
        let origin = direction((7 * i) % 20_000, 20_000) * distance;
        let aim = direction((13 * i) % 19_997, 19_997) * 60.0;
        let way = (aim - origin) * [1e-3, 1.0, 3e-2][i / 3 % 3];
        let rounded = |v: DVec3| v.as_vec3().as_dvec3();
        rays.push((rounded(origin), rounded(way)));
    }
    let mut engine = Engine::for_tests();
    for (kind, solid) in solids.iter().enumerate() {
        let size = match *solid {
            Solid::Plane { half } => [half.x, half.y, 0.0, 0.0],
            Solid::Sphere { radius } => [radius, 0.0, 0.0, 0.0],
            Solid::Cylinder {
                radius,
                half_length,
            } => [radius, half_length, 0.0, 0.0],
            Solid::Frustum { faces } => [faces[2].0.x, faces[2].0.z, faces[2].1, faces[0].1],
        };
        let mut input = Vec::new();
        for (origin, way) in &rays {
            input.extend(words(*origin));
            input.extend(words(*way));
            input.extend([0, kind as u32]);
            input.extend(size.map(|s| (s as f32).to_bits()));
        }
        let output = engine.call("tests/solid_test", &input, 5 * rays.len(), rays.len());
        let (mut other, mut hits) = (0, 0);
        let (mut off, mut turned): (f64, f64) = (0.0, 0.0);
        for ((origin, way), out) in rays.iter().zip(output.chunks(5)) {
            let wanted = solid.intersect(*origin, *way, 0.0);
            let is_hit = f(out[0]) < 1e38;
            let Some(wanted) = wanted.filter(|w| is_hit && w.facet == out[1]) else {
                other += usize::from(is_hit || wanted.is_some());
                continue;
            };
            // For a grazing ray, rounding shifts the hit point far along the ray.
            let facing = wanted.normal.dot(way.normalize()).abs();
            let from = (wanted.t - f(out[0])).abs() * way.length();
            let normal = DVec3::new(f(out[2]), f(out[3]), f(out[4]));
            off = off.max(from * facing);
            turned = turned.max((normal - wanted.normal).length() * facing);
            hits += 1;
        }
        println!(
            "{kind}: {hits} hits off by {off:.1e} mm, normals by {turned:.1e}, {other} others"
        );
        assert!(hits > 5000 && other <= 4);
        assert!(off < 5e-4 && turned < 1e-5);
    }
}

/// Returns whether another ray within the rounding error of `ray` hits at the parameter `found`, as
/// can happen at edges that the ray grazes.
fn is_of_a_ray_beside(
    world: &World,
    origin: DVec3,
    ray: DVec3,
    found: f64,
    scratch: &mut Scratch,
) -> bool {
    let beside: [DVec3; LANES] = std::array::from_fn(|lane| {
        let turn = std::f64::consts::TAU * lane as f64 / LANES as f64;
        ray + DVec3::new(turn.cos(), turn.sin(), 0.0) * 1e-6
    });
    let hits = world.nearest(origin, &beside, &[true; LANES], scratch);
    hits.t
        .iter()
        .any(|t| (t.min(1e30) - found).abs() <= 1e-5 * found)
}

/// Casts rays, each given with its image row, on the CPU and on the GPU, and compares the hits.
fn rays_off(engine: &mut Engine, case: &mut Case, rays: &[(usize, DVec3, DVec3)], name: &str) {
    case.scene.update(engine, &case.worlds, 171);
    optics::write(engine, &case.optics);
    let mut input = Vec::new();
    for &(row, origin, direction) in rays {
        input.push(row as u32);
        input.extend(words(origin));
        input.extend(words(direction));
    }
    let output = engine.call("tests/world_test", &input, 6 * rays.len(), rays.len());
    let mut scratch = Scratch::default();
    let (mut hits, mut deeper, mut nearer, mut shades, mut leaves) = (0, 0, 0, 0, 0);
    let mut off: f64 = 0.0;
    let towards = DVec3::new(-0.6, -0.3, -0.7).normalize();
    for (&(row, origin, direction), out) in rays.iter().zip(output.chunks(6)) {
        let world = case.worlds.at(row);
        let world: &World = &world;
        let alone: [bool; LANES] = std::array::from_fn(|lane| lane == 0);
        let all = [direction; LANES];
        let wanted = world.nearest(origin, &all, &alone, &mut scratch);
        let surface = Surface(out[1]);
        // Without a hit both distances are infinite.
        let (mine, found) = (wanted.t[0].min(1e30), f(out[0]).min(1e30));
        let far = (mine - found).abs() / mine;
        if far > 1e-5 && !is_of_a_ray_beside(world, origin, direction, found, &mut scratch) {
            deeper += usize::from(found > mine);
            nearer += usize::from(found < mine);
            continue;
        }
        if !wanted.is_hit(0) || far > 1e-5 {
            continue;
        }
        hits += 1;
        off = off.max(far);
        if wanted.surface[0] != surface {
            continue;
        }
        let point = origin + direction * wanted.t[0];
        let points = std::array::from_fn(|lane| (lane == 0).then_some((point, surface)));
        let lamp = world.blocked(DVec3::new(0.0, -100.0, 0.0), &points, &mut scratch)[0];
        let sun = world.blocked_along(towards, &points, &mut scratch)[0];
        shades += usize::from(lamp != (out[2] == 1)) + usize::from(sun != (out[3] == 1));
        let normal = wanted.normal(0);
        let mirrored = (direction - 2.0 * normal * normal.dot(direction)).normalize();
        let met = world.leaving(point, surface, &[mirrored; LANES], &mut scratch);
        let agrees = match (met.is_hit(0), f(out[4]) < 1e38) {
            (true, true) => (met.t[0] - f(out[4])).abs() < 1e-3 * met.t[0].max(10.0),
            (a, b) => a == b,
        };
        leaves += usize::from(!agrees);
    }
    println!(
        "{name}: {hits} hits off by {off:.1e}, {deeper} deeper, {nearer} nearer, {shades} shadows, {leaves} mirrored"
    );
    let some = rays.len() / 1000 + 2;
    assert!(hits > rays.len() / 6 && shades <= some && leaves <= 2 * some);
    // A ray that grazes a silhouette may hit or miss. For an unknown reason, a few in ten thousand
    // of the rays through corners and edges hit another triangle; a larger edge tolerance does not
    // change the number of deeper hits. This test limits their number; it does not show that no ray
    // passes between triangles.
    assert!(deeper <= some && nearer <= 4 * some);
}

/// GPU and CPU agree for random rays from a slightly offset pupil, and for rays through vertices and
/// edge midpoints of triangles.
#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_rays_match_the_cpu() {
    let mut engine = Engine::for_tests();
    let profile = small(Profile::load("pmp-bench").unwrap());
    let folder = tempfile::tempdir().unwrap();
    let scenes = [
        Scene::load("torso").unwrap(),
        Scene::load("couch").unwrap(),
        Scene::parse(SOLIDS, "solids").unwrap(),
        moving(folder.path()),
    ];
    let spread = |i: usize| direction((31 * i) % 9973, 9973) * DVec3::new(0.4, 0.3, 0.0);
    for scene in &scenes {
        let mut case = Case::new(profile.clone(), scene);
        let mut rays: Vec<_> = (0..6000)
            .map(|i| {
                let origin = direction((17 * i) % 6007, 6007) * DVec3::new(3.0, 3.0, 0.0);
                (0, origin, spread(i) + DVec3::Z)
            })
            .collect();
        rays_off(&mut engine, &mut case, &rays, &scene.name);
        let world = case.worlds.any();
        rays.clear();
        for i in 0..world.triangle_count().min(20_000) {
            let [a, b, c] = world.corners(Surface(i as u32)).unwrap();
            for p in [a, (b + c) / 2.0] {
                rays.push((0, DVec3::ZERO, p / p.z));
            }
        }
        if !rays.is_empty() {
            rays_off(&mut engine, &mut case, &rays, "of edges");
        }
    }
}
