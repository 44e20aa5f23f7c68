//! Upper bounds of interreflected light, and options that must not change the result.

use crate::interreflection::*;
use crate::photometry::scene;
use glam::DVec3;
use phasmid::emulator::PatternImage;
use phasmid::emulator::render::{Renderer, Term};
use phasmid::geometry::{Mesh, ply};
use phasmid::pattern::Axis;
use phasmid::profile::Profile;
use std::f64::consts::{PI, TAU};

/// Returns a sphere meshed by longitude and latitude.
fn ball(center: DVec3, radius: f64, across: u32) -> Mesh {
    let (columns, rows) = (2 * across, across);
    let mut mesh = Mesh::default();
    for j in 0..=rows {
        for i in 0..columns {
            let lat = PI * f64::from(j) / f64::from(rows);
            let lon = TAU * f64::from(i) / f64::from(columns);
            let unit = DVec3::new(lat.sin() * lon.cos(), lat.cos(), lat.sin() * lon.sin());
            mesh.vertices.push(center + unit * radius);
        }
    }
    let at = |i: u32, j: u32| j * columns + i % columns;
    for j in 0..rows {
        for i in 0..columns {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

#[test]
fn convex_scenes_have_no_interreflection() {
    let profile = Profile::load("pmp-bench").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let round = ball(DVec3::new(20.0, -10.0, 940.0), 75.0, 60);
    ply::write_mesh(&folder.path().join("ball.ply"), &round).unwrap();
    let mut sheet = Mesh::default();
    let corner = |k: i32| f64::from(k - 20) * 31.7;
    for k in 0..41 * 41 {
        let (x, y) = (corner(k % 41), corner(k / 41));
        sheet
            .vertices
            .push(DVec3::new(x, y, 1000.0 + 0.3 * x - 0.1 * y));
        if k % 41 < 40 && k / 41 < 40 {
            let k = k as u32;
            sheet
                .triangles
                .extend([[k, k + 1, k + 42], [k, k + 42, k + 41]]);
        }
    }
    ply::write_mesh(&folder.path().join("sheet.ply"), &sheet).unwrap();
    for shape in [
        "{ kind = \"plane\" }\nposition_mm = [0, 0, 1000]\nrotation_deg = [5, -8, 0]",
        "{ kind = \"sphere\", radius_mm = 75.0 }\nposition_mm = [0, 0, 940]",
        "{ kind = \"mesh\", file = \"ball.ply\" }",
        "{ kind = \"mesh\", file = \"sheet.ply\" }",
    ] {
        let text = format!(
            "{}[[light]]\nkind = \"point\"\nposition_mm = [-300, 200, 400]\n\
             intensity_w_sr = 0.12\n[[object]]\nshape = {shape}\nalbedo = 0.7\n",
            wanted(64, 4)
        );
        let scene = scene(&text, folder.path());
        let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
        let solid = !shape.contains("mesh");
        assert_ne!(renderer.plan().has(Term::Interreflection), solid, "{shape}");
        let shot = shot(Some(fringe(&profile, Axis::X, 16.0)));
        renderer.force(Term::Interreflection, true);
        let with = renderer.expose(&shot).data;
        let expected = renderer.expected_dn(&shot);
        renderer.force(Term::Interreflection, false);
        assert_eq!(expected, renderer.expected_dn(&shot), "{shape}");
        assert_eq!(with, renderer.expose(&shot).data, "{shape}");
    }
}

#[test]
fn interreflection_is_linear_and_conserves_energy() {
    let mut profile = Profile::load("pmp-bench").unwrap();
    profile.camera.height_px = 163;
    profile.projector.radiant_intensity_w_sr = 0.4;
    let mut renderer = Renderer::new(&profile, &clutter(64, 4), 1).unwrap();
    let full = |level| PatternImage::Row(Axis::X, vec![level; 1920]);
    let inverse = |pattern_image: &PatternImage| match pattern_image {
        PatternImage::Row(axis, levels) => {
            PatternImage::Row(*axis, levels.iter().map(|l| 255 - l).collect())
        }
        _ => panic!("a fringe is a row"),
    };
    let mut of =
        |pattern_image: PatternImage| bounced(&profile, &mut renderer, &shot(Some(pattern_image)));
    let (dark, uniform) = (of(full(0)), of(PatternImage::Uniform(255)));
    // Irradiance by the projector at the nearest distance of about 800 mm, plus irradiance by the
    // lamp, each after two reflections with an albedo of at most 0.85.
    let most = 0.85f64.powi(2) * (0.4e6 / 6.4e5 + 0.04e6 / 1e5);
    assert!(uniform.iter().all(|&e| (-1e-6..most).contains(&e)));
    assert!(uniform.iter().filter(|&&e| e > 0.01).count() > 30_000);
    for pattern_image in [
        fringe(&profile, Axis::X, 16.0),
        fringe(&profile, Axis::Y, 40.0),
        full(255),
    ] {
        let (one, other) = (of(pattern_image.clone()), of(inverse(&pattern_image)));
        for i in 0..one.len() {
            let sum = one[i] + other[i] - dark[i];
            assert!((sum - uniform[i]).abs() < 1e-5, "{i}: {sum} {}", uniform[i]);
            assert!(one[i] > dark[i] - 1e-6 && one[i] < uniform[i] + 1e-6);
        }
    }
}
#[test]
fn coarser_grids_are_near_and_say_the_same_of_geometry() {
    let mut profile = Profile::load("pmp-bench").unwrap();
    profile.projector.radiant_intensity_w_sr = 0.4;
    let image = |step_px| {
        let mut renderer = Renderer::new(&profile, &clutter(16, step_px), 1).unwrap();
        let light = bounced(
            &profile,
            &mut renderer,
            &shot(Some(PatternImage::Uniform(255))),
        );
        (light, renderer.truth(&[]))
    };
    let (fine, truth) = image(1);
    let mut plain = Renderer::new(&profile, &clutter(16, 1), 1).unwrap();
    plain.force(Term::Interreflection, false);
    let bare = plain.truth(&[]);
    let same = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits());
    assert_eq!(truth.flags, bare.flags);
    assert!(same(&truth.depth_mm, &bare.depth_mm));
    assert!(same(&truth.projector_x, &bare.projector_x));
    assert!(same(&truth.projector_y, &bare.projector_y));
    // The error of sixteen rays differs from point to point, so only means over many points are
    // compared.
    for (step, [relative, absolute]) in [(4, [0.01, 1e-4]), (16, [0.03, 5e-4])] {
        let (coarse, _) = image(step);
        for block in 0..9 {
            let (left, top) = (230 + block % 3 * 220, 20 + block / 3 * 150);
            let mean = |light: &[f64]| {
                let rows = top..top + 150;
                let sum: f64 = rows
                    .map(|v| light[v * 1138 + left..][..220].iter().sum::<f64>())
                    .sum();
                sum / (150.0 * 220.0)
            };
            let (a, b) = (mean(&fine), mean(&coarse));
            let bar = relative * a + absolute;
            assert!((a - b).abs() < bar, "{step} {block}: {a} {b}");
        }
    }
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let profile = Profile::load("pmp-bench").unwrap();
    let scene = clutter(16, 8);
    let render = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let mut renderer = Renderer::new(&profile, &scene, 42).unwrap();
            [Some(fringe(&profile, Axis::X, 16.0)), None]
                .map(|pattern_image| renderer.expose(&shot(pattern_image)).data)
        })
    };
    let one = render(1);
    assert_eq!(one, render(2));
    assert_eq!(one, render(3));
}
