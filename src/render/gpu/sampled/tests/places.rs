//! Compares the positions of samples, and the widths of footprints under blur.

use super::super::super::{Engine, EntryPoint};
use super::Case;
use crate::Plan;
use crate::transport::{offset, pupil_index, turn, widened};
use phasmid_profile::{Profile, Scene};

/// Returns a profile with a small image and this focus distance in millimetres.
fn focused(focus_mm: f64) -> Profile {
    let mut profile = Profile::load("pmp-bench").unwrap();
    (profile.camera.width_px, profile.camera.height_px) = (151, 70);
    profile.camera.f_number = 2.0;
    profile.camera.focus_mm = Some(focus_mm);
    profile
}

fn call(engine: &mut Engine, entry: &'static str, input: &[u32]) -> Vec<[f32; 4]> {
    let stage = EntryPoint::new("tests/samples_test", entry, &Plan::default());
    let output = engine.call_stage(&stage, input, input.len(), input.len() / 4);
    bytemuck::cast_vec(output)
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_sample_positions_match_the_cpu() {
    let mut case = Case::new(focused(900.0), &Scene::load("plane").unwrap(), 16);
    let (engine, aperture) = (&mut Engine::for_tests(), case.aperture());
    let (width, height) = (151usize, 70usize);
    for (samples, side) in [(4, 4usize), (16, 4), (64, 8)] {
        case.options.samples = samples;
        let mut sampler = case.sampler(engine);
        assert_eq!(sampler.side, side, "depth of field takes sixteen");
        for rows in [4, 1] {
            sampler.data.rows = rows as u32;
            sampler.write(engine);
            let asked: Vec<[usize; 4]> = (0..width * height)
                .map(|i| [i % width, i / width, i * 7 % (side * side), side])
                .collect();
            let input: Vec<u32> = asked.iter().flatten().map(|&n| n as u32).collect();
            let found = call(engine, "places", &input);
            for ([u, v, k, side], found) in asked.into_iter().zip(found) {
                let (across, count) = (16 / rows, side * side);
                let tile = v / rows * width.div_ceil(across) + u / across;
                let point = aperture.point(pupil_index(k, count), count, turn(tile));
                let offset = offset(k, side);
                let wanted = [point.x, point.y, offset.x, offset.y];
                for (found, wanted) in found.into_iter().zip(wanted) {
                    assert!((f64::from(found) - wanted).abs() < 2e-6, "{u} {v} {k}");
                }
            }
        }
    }
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_blur_widens_as_on_the_cpu() {
    let case = Case::new(focused(900.0), &Scene::load("plane").unwrap(), 16);
    let (engine, aperture) = (&mut Engine::for_tests(), case.aperture());
    case.sampler(engine);
    let sizes = [0.0f32, 1e-4, 0.1, 0.7, 1.0, 3.0, 500.0];
    let depths = [
        0.0f32, 0.001, 50.0, 600.0, 850.0, 899.9, 900.0, 901.0, 940.0, 1e4, 1e6,
    ];
    let mut asked = Vec::new();
    for depth in depths {
        for a in sizes {
            asked.extend(sizes.map(|b| [a, -b, depth, 0.0]));
        }
    }
    let input: Vec<u32> = asked.iter().flatten().map(|v| v.to_bits()).collect();
    for ([a, b, depth, _], found) in asked.into_iter().zip(call(engine, "widths", &input)) {
        let radius = match depth {
            0.0 => 0.0,
            depth => aperture.blur_px(depth.into()),
        };
        assert!((f64::from(found[2]) - radius).abs() < 3e-6 * radius + 2e-6);
        let wanted = widened([a, b], radius, aperture.pixel_aspect);
        let energy = |[a, b]: [f32; 2]| f64::from(a).hypot(b.into());
        let (now, then) = (energy([found[0], found[1]]), energy(wanted));
        assert!(
            (now - then).abs() <= 5e-6 * then,
            "{a} {b} {depth}: {found:?} {wanted:?}"
        );
        for (found, wanted) in found.into_iter().zip(wanted) {
            // Near the maximum blur that two boxes can represent, a square root loses half of the
            // digits.
            let bar = 5e-4 * then as f32;
            assert!(
                (found - wanted).abs() <= bar,
                "{a} {b} {depth}: {found} {wanted}"
            );
        }
    }
}
