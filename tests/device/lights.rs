//! Lamps and mains flicker, compared with closed forms and the reference renderer.

use crate::photometry::{dn_per_irradiance, scene};
use glam::{DVec2, DVec3};
use phasmid::emulator::render::reference::Reference;
use phasmid::emulator::render::{Options, Renderer, Term};
use phasmid::emulator::{PatternImage, Shot, Truth};
use phasmid::geometry::{Mesh, ply};
use phasmid::profile::{Profile, Scene};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::path::Path;

fn dark(start_ns: u64, exposure_ns: u64) -> Shot {
    Shot {
        start_ns,
        exposure_ns,
        ..Shot::default()
    }
}

const PLANE: &str = "[[object]]\nshape = { kind = \"plane\" }\nposition_mm = [0, 0, 1000]\n\
                     rotation_deg = [5, -8, 0]\nalbedo = 0.7\n";

/// Returns the points that the pixels see, in the rig's frame.
fn points(profile: &Profile, truth: &Truth) -> Vec<DVec3> {
    let view = profile.camera.view();
    (0..truth.flags.len())
        .map(|i| {
            let px = DVec2::new((i % 1138) as f64, (i / 1138) as f64);
            let ray = view.ray(px);
            ray / ray.z * f64::from(truth.depth_mm[i])
        })
        .collect()
}

#[test]
fn lamps_on_a_plane_follow_their_closed_form() {
    let profile = Profile::load("pmp-bench").unwrap();
    let lamps = "[[light]]\nkind = \"point\"\nposition_mm = [-300, 200, 400]\n\
                 intensity_w_sr = 0.12\n[[light]]\nkind = \"directional\"\n\
                 direction = [3, 1, 2]\nirradiance_w_m2 = 0.3\n[[light]]\nkind = \"point\"\n\
                 position_mm = [0, 0, 3000]\nintensity_w_sr = 1e6\n";
    let scene = scene(&format!("{lamps}{PLANE}"), Path::new(""));
    let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
    let truth = renderer.truth(&[]);
    let found = renderer.expected_dn(&dark(0, 8_000_000));
    let normal = scene.object[0].scene_from_object().direction(DVec3::NEG_Z);
    let scale = 0.7 * dn_per_irradiance(&profile, 8e-3);
    let black = profile.camera.sensor.black_level_dn;
    for (i, point) in points(&profile, &truth).into_iter().enumerate() {
        let way = DVec3::new(-300.0, 200.0, 400.0) - point;
        let one = 0.12 * 1e6 * normal.dot(way) / way.length().powi(3);
        let other = 0.3 * normal.dot(-DVec3::new(3.0, 1.0, 2.0).normalize());
        // The third lamp is behind the plane and adds nothing.
        let exact = black + scale * (one + other);
        assert!(exact > 10.0 && exact < 250.0);
        assert!(
            (f64::from(found[i]) - exact).abs() < 1e-3,
            "{i}: {} {exact}",
            found[i]
        );
    }
    renderer.force(Term::Lights, false);
    let without = renderer.expected_dn(&dark(0, 8_000_000));
    assert!(without.iter().all(|&dn| dn == black as f32));
}

/// Returns a sphere meshed by longitude and latitude, and two triangles behind it.
fn ball_before_wall(center: DVec3, radius: f64, wall_z: f64) -> Mesh {
    let (columns, rows) = (512, 256);
    let mut mesh = Mesh::default();
    for j in 0..=rows {
        for i in 0..columns {
            let (lat, lon) = (
                PI * f64::from(j) / f64::from(rows),
                2.0 * PI * f64::from(i) / f64::from(columns),
            );
            let unit = DVec3::new(lat.sin() * lon.cos(), lat.cos(), lat.sin() * lon.sin());
            mesh.vertices.push(center + unit * radius);
        }
    }
    let at = |i: u32, j: u32| j * columns as u32 + i % columns as u32;
    for j in 0..rows as u32 {
        for i in 0..columns as u32 {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    let first = mesh.vertices.len() as u32;
    for (x, y) in [(-2e3, -2e3), (2e3, -2e3), (2e3, 2e3), (-2e3, 2e3)] {
        mesh.vertices.push(DVec3::new(x, y, wall_z));
    }
    mesh.triangles
        .extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    mesh
}

#[test]
fn shadows_end_where_the_occluder_does() {
    let profile = Profile::load("pmp-bench").unwrap();
    let dir = tempfile::tempdir().unwrap();
    let (center, radius, wall) = (DVec3::new(-60.0, 20.0, 900.0), 50.0, 1000.0);
    let mesh = ball_before_wall(center, radius, wall);
    ply::write_mesh(&dir.path().join("ball.ply"), &mesh).unwrap();
    let solids = format!(
        "[[object]]\nshape = {{ kind = \"plane\" }}\nposition_mm = [0, 0, {wall}]\nalbedo = 0.7\n\
         [[object]]\nshape = {{ kind = \"sphere\", radius_mm = {radius} }}\n\
         position_mm = [-60, 20, 900]\nalbedo = 0.7\n"
    );
    let meshed = "[[object]]\nshape = { kind = \"mesh\", file = \"ball.ply\" }\nalbedo = 0.7\n";
    let far = "[[light]]\nkind = \"directional\"\ndirection = [2, 0.5, 1.5]\nirradiance_w_m2 = 1\n";
    let near = "[[light]]\nkind = \"point\"\nposition_mm = [-500, -80, 500]\n\
                intensity_w_sr = 0.4\n";
    let direction = DVec3::new(2.0, 0.5, 1.5).normalize();
    let lamp = DVec3::new(-500.0, -80.0, 500.0);
    for objects in [solids.as_str(), meshed] {
        for (text, is_far) in [(far, true), (near, false)] {
            let scene = scene(&format!("{text}{objects}"), dir.path());
            let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
            let truth = renderer.truth(&[]);
            let found = renderer.expected_dn(&dark(0, 8_000_000));
            let black = profile.camera.sensor.black_level_dn as f32;
            let bright = found.iter().copied().fold(0.0, f32::max);
            let (mut shaded, mut soft) = (0, 0);
            for (i, point) in points(&profile, &truth).into_iter().enumerate() {
                if truth.flags[i] & Truth::CREASE != 0 {
                    let part = (found[i] - black) / (bright - black);
                    soft += usize::from(part > 0.1 && part < 0.5);
                    continue;
                }
                let along = if is_far {
                    direction
                } else {
                    (point - lamp).normalize()
                };
                let to_center = center - point;
                let on_wall = (point.z - wall).abs() < 1e-3;
                // The parts of the sphere that face away from the light are dark.
                let off = if on_wall {
                    to_center.cross(along).length() - radius
                } else {
                    -along.dot(-to_center) * 2.0
                };
                // The facets of the mesh lie up to 0.004 mm inside the sphere, and its terminator is
                // off by up to the size of a facet, 0.6 mm.
                if off.abs() < 2.0 {
                    continue;
                }
                let dark = (found[i] - black).abs() < 1e-3;
                assert_eq!(dark, off < 0.0, "{point} {off}: {}", found[i]);
                shaded += usize::from(dark && on_wall);
            }
            assert!(shaded > 500, "{shaded}");
            assert!(
                soft > 50,
                "pixels on the shadow's edge see a part of it: {soft}"
            );
        }
    }
}

#[test]
fn lamps_agree_with_the_reference_path() {
    let profile = Profile::load("pmp-bench").unwrap();
    let lamps = "[[light]]\nkind = \"point\"\nposition_mm = [-200, -300, 500]\n\
                 intensity_w_sr = 0.1\n[[light]]\nkind = \"directional\"\n\
                 direction = [-1, 0.5, 1]\nirradiance_w_m2 = 0.4\n";
    let objects = "[[object]]\nshape = { kind = \"plane\" }\nposition_mm = [0, 0, 1150]\n\
                   albedo = 0.5\n[[object]]\nshape = { kind = \"torso\", triangles = 1500 }\n\
                   position_mm = [0, 0, 1150]\nrotation_deg = [0, 0, 80]\nalbedo = 0.6\n";
    let scene = scene(&format!("{lamps}{objects}"), Path::new(""));
    let reference = Reference::new(&profile, &scene).unwrap();
    let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
    let flags = renderer.truth(&[]).flags;
    let found = renderer.expected_dn(&dark(0, 8_000_000));
    let pattern_image = PatternImage::Uniform(0);
    let wanted = (0..found.len()).step_by(2531);
    let errors: Vec<f64> = wanted
        .filter(|&i| flags[i] & Truth::CREASE == 0)
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|i| {
            let px = DVec2::new((i % 1138) as f64, (i / 1138) as f64);
            (reference.signal_dn(px, &pattern_image, 8e-3, 24) - f64::from(found[i])).abs()
        })
        .collect();
    let worst = errors.iter().copied().fold(0.0, f64::max);
    let exact = errors.iter().filter(|&&e| e < 0.5).count();
    // The production renderer treats a crease below 15 degrees as one smooth surface; the reference
    // averages the light on both sides of it.
    assert!(
        exact * 100 >= errors.len() * 97 && worst < 6.0,
        "{exact} of {}: {worst}",
        errors.len()
    );
}

/// Lamps and their shadows agree with the reference when seen through the whole pupil, with the
/// camera's vignetting.
#[test]
fn lamps_are_seen_out_of_focus_and_dimmed_towards_the_edge() {
    let mut profile = Profile::load("pmp-bench").unwrap();
    profile.camera.focus_mm = Some(900.0);
    profile.camera.vignetting.natural = true;
    profile.camera.vignetting.falloff = [-0.3, 0.05, 0.0];
    let text = "[[light]]\nkind = \"point\"\nposition_mm = [-200, -300, 500]\n\
                intensity_w_sr = 0.1\n[[light]]\nkind = \"directional\"\n\
                direction = [-1, 0.5, 1]\nirradiance_w_m2 = 0.4\n\
                [[object]]\nshape = { kind = \"plane\" }\nposition_mm = [0, 0, 1150]\n\
                albedo = 0.5\n[[object]]\nshape = { kind = \"sphere\", radius_mm = 90 }\n\
                position_mm = [10, 20, 850]\nalbedo = 0.6\n";
    let scene = scene(text, Path::new(""));
    let reference = Reference::new(&profile, &scene).unwrap();
    for samples in [16, 64] {
        let options = Options {
            samples,
            ..Options::default()
        };
        let mut renderer = Renderer::with_options(&profile, &scene, 1, options).unwrap();
        let flags = renderer.truth(&[]).flags;
        let found = renderer.expected_dn(&dark(0, 8_000_000));
        let worst = |wanted: u8, step: usize, rays: u32| {
            (0..found.len())
                .filter(|&i| flags[i] & Truth::CREASE == wanted)
                .step_by(step)
                .collect::<Vec<_>>()
                .into_par_iter()
                .map(|i| {
                    let px = DVec2::new((i % 1138) as f64, (i / 1138) as f64);
                    let exact = reference.signal_dn(px, &PatternImage::Uniform(0), 8e-3, rays);
                    (exact - f64::from(found[i])).abs()
                })
                .reduce(|| 0.0, f64::max)
        };
        let (smooth, mixed) = (worst(0, 2531, 24), worst(Truth::CREASE, 211, 4000));
        assert!(smooth < 0.3, "{samples}: {smooth}");
        assert!(mixed < 3.0, "{samples}: {mixed}");
    }
}

/// A rig rotated by 90 degrees about z and shifted gives the lamp positions that are computed by
/// hand.
#[test]
fn lamps_stand_in_the_frame_of_the_scene() {
    let profile = Profile::load("pmp-bench").unwrap();
    let seen = |rig: &str, turned: &dyn Fn([f64; 3]) -> [f64; 3], shift: [f64; 3]| {
        let place = |p: [f64; 3]| std::array::from_fn::<_, 3, _>(|i| turned(p)[i] + shift[i]);
        let text = format!(
            "{rig}[[light]]\nkind = \"point\"\nposition_mm = {:?}\nintensity_w_sr = 0.1\n\
             [[light]]\nkind = \"directional\"\ndirection = {:?}\nirradiance_w_m2 = 0.3\n\
             [[object]]\nshape = {{ kind = \"plane\" }}\nposition_mm = {:?}\nalbedo = 0.7\n\
             [[object]]\nshape = {{ kind = \"sphere\", radius_mm = 90 }}\nposition_mm = {:?}\n\
             albedo = 0.6\n",
            place([-300.0, 200.0, 400.0]),
            turned([3.0, 1.0, 2.0]),
            place([0.0, 0.0, 1150.0]),
            place([10.0, 20.0, 850.0]),
        );
        let scene = scene(&text, Path::new(""));
        let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
        let flags = renderer.truth(&[]).flags;
        (renderer.expected_dn(&dark(0, 8_000_000)), flags)
    };
    let (here, flags) = seen("", &|p| p, [0.0; 3]);
    let rig = "[rig]\nposition_mm = [100, -50, 200]\nrotation_deg = [0, 0, 90]\n";
    let (there, _) = seen(rig, &|[x, y, z]| [-y, x, z], [100.0, -50.0, 200.0]);
    let whole = |i: &usize| flags[*i] & Truth::CREASE == 0;
    for i in (0..here.len()).filter(whole) {
        let (a, b) = (here[i], there[i]);
        assert!((a - b).abs() < 1e-3, "{i}: {a} {b}");
    }
    assert!(flags.iter().any(|f| f & Truth::CREASE != 0));
}

const FLICKERING: &str = "ambient = { irradiance_w_m2 = 0.1, flicker = { frequency_hz = 100, \
    depth = 0.4, phase_deg = 25 } }\n[[light]]\nkind = \"directional\"\ndirection = [0, 0, 1]\n\
    irradiance_w_m2 = 0.2\nflicker = { frequency_hz = 100, depth = 0.9, phase_deg = 25 }\n\
    [[light]]\nkind = \"directional\"\ndirection = [0, 0, 1]\nirradiance_w_m2 = 0.05\n\
    [[object]]\nshape = { kind = \"plane\" }\nposition_mm = [0, 0, 1000]\nalbedo = 0.7\n";

#[test]
fn flicker_is_the_integral_over_each_exposure() {
    let profile = Profile::load("pmp-bench").unwrap();
    let scene = scene(FLICKERING, Path::new(""));
    let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
    let black = profile.camera.sensor.black_level_dn;
    let scale = 0.7 * dn_per_irradiance(&profile, 1.0);
    for (start, exposure) in [
        (0, 1_000_000),
        (3_300_000, 4_000_000),
        (1_000_000_000_000_003_000, 7_500_000),
        (5_000_000, 17_000_000),
    ] {
        let n = 4000;
        let step = exposure as f64 * 1e-9 / f64::from(n);
        // Multiples of 0.1 s are whole periods of the flicker, so they are left out.
        let begin = (start % 100_000_000) as f64 * 1e-9;
        let integral: f64 = (0..n)
            .map(|i| {
                let t = begin + (f64::from(i) + 0.5) * step;
                let wave = (2.0 * PI * 100.0 * t + f64::to_radians(25.0)).cos();
                step * (0.1 * (1.0 + 0.4 * wave) + 0.2 * (1.0 + 0.9 * wave) + 0.05)
            })
            .sum();
        let exact = black + scale * integral;
        let found = renderer.expected_dn(&dark(start, exposure));
        assert!(exact < 250.0);
        for dn in found {
            assert!(
                (f64::from(dn) - exact).abs() < 1e-3,
                "{start}: {dn} {exact}"
            );
        }
    }
}

/// If all light flickers by the same factor, so do all pixels, however the light is averaged.
#[test]
fn mixed_pixels_flicker_by_the_same_factor() {
    let mut profile = Profile::load("pmp-bench").unwrap();
    profile.camera.vignetting.natural = true;
    let black = profile.camera.sensor.black_level_dn as f32;
    let flicker = "flicker = { frequency_hz = 120, depth = 0.8, phase_deg = -40 }";
    let text = format!(
        "ambient = {{ irradiance_w_m2 = 0.1, {flicker} }}\n[[light]]\nkind = \"point\"\n\
         position_mm = [-300, 200, 400]\nintensity_w_sr = 0.05\n{flicker}\n{PLANE}\
         [[object]]\nshape = {{ kind = \"sphere\", radius_mm = 90 }}\nposition_mm = [0, 0, 800]\n\
         albedo = 0.9\n"
    );
    let (start, exposure) = (1_700_000, 2_100_000);
    // Integral of the flicker over the exposure, from its antiderivative.
    let (w, phase) = (2.0 * PI * 120.0, f64::to_radians(-40.0));
    let (from, to) = (start as f64 * 1e-9, (start + exposure) as f64 * 1e-9);
    let mean = ((w * to + phase).sin() - (w * from + phase).sin()) / (w * (to - from));
    let factor = (1.0 + 0.8 * mean) as f32;
    assert!((factor - 1.0).abs() > 0.1);
    for (samples, focus_mm) in [(1, None), (4, None), (64, None), (16, Some(1000.0))] {
        profile.camera.focus_mm = focus_mm;
        let options = Options {
            samples,
            ..Options::default()
        };
        let mut renderer =
            Renderer::with_options(&profile, &scene(&text, Path::new("")), 1, options).unwrap();
        let found = renderer.expected_dn(&dark(start, exposure));
        let flags = renderer.truth(&[]).flags;
        assert!(flags.iter().filter(|f| **f & Truth::CREASE != 0).count() > 300);
        renderer.force(Term::Flicker, false);
        let steady = renderer.expected_dn(&dark(start, exposure));
        for (i, (found, steady)) in found.iter().zip(steady).enumerate() {
            let exact = black + factor * (steady - black);
            assert!(
                (found - exact).abs() < 1e-4 * exact,
                "{samples} {i}: {found} {exact}"
            );
        }
    }
}

#[test]
fn exposures_of_whole_periods_do_not_flicker() {
    let profile = Profile::load("pmp-bench").unwrap();
    let scene = scene(FLICKERING, Path::new(""));
    let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
    let first = renderer.expose(&dark(0, 10_000_000)).data;
    for start in [1, 2_345_678, 999_999_999_999_999_999] {
        assert_eq!(renderer.expose(&dark(start, 10_000_000)).data, first);
    }
    let short = renderer.expose(&dark(0, 2_000_000)).data;
    assert_ne!(renderer.expose(&dark(5_000_000, 2_000_000)).data, short);
    renderer.force(Term::Flicker, false);
    assert_eq!(renderer.expose(&dark(0, 10_000_000)).data, first);
}

#[test]
fn impossible_lamps_are_refused() {
    for (from, to, says) in [
        (
            "frequency_hz = 100, depth = 0.9",
            "frequency_hz = 50, depth = 0.9",
            "100 or 120",
        ),
        (
            "depth = 0.9",
            "depth = 1.1",
            "light[0].flicker.depth: 1.1; expected 0 to 1",
        ),
        (
            "depth = 0.9, phase_deg = 25",
            "depth = 0.9, phase_deg = 26",
            "100 Hz at 25 degrees",
        ),
        (
            "direction = [0, 0, 1]",
            "direction = [0, 0, 0]",
            "light[0].direction",
        ),
        (
            "irradiance_w_m2 = 0.2",
            "irradiance_w_m2 = -0.2",
            "light[0].irradiance_w_m2",
        ),
        (
            "irradiance_w_m2 = 0.2",
            "intensity_w_sr = 0.2",
            "intensity_w_sr",
        ),
        ("kind = \"directional\"", "kind = \"lamp\"", "lamp"),
    ] {
        let text = format!("name = \"s\"\ndescription = \"\"\n{FLICKERING}");
        assert!(text.contains(from));
        let error = Scene::parse(&text.replacen(from, to, 1), "s.toml").unwrap_err();
        assert!(error.to_string().contains(says), "{error}");
        assert!(error.to_string().starts_with("s.toml:"), "{error}");
    }
}
