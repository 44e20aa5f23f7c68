//! Textures and vertex colours, compared with finer sampling and with each other.

use crate::photometry::{dn_per_irradiance, scene};
use glam::DVec2;
use phasmid::emulator::render::{Options, Renderer, Term};
use phasmid::emulator::{PatternImage, Shot};
use phasmid::profile::{Profile, Scene};
use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;

fn white(profile: &Profile) -> Shot {
    let level = (1 << profile.projector.bits) - 1;
    Shot {
        pattern_image: Some(Arc::new(PatternImage::Uniform(level))),
        light: 1.0,
        exposure_ns: 8_000_000,
        ..Shot::default()
    }
}

/// Writes a checkerboard of `n` x `n` texels as a PNG.
fn checkerboard(path: &Path, n: u32) {
    let texel = |x: u32, y: u32| image::Luma([if (x + y).is_multiple_of(2) { 0 } else { 255u8 }]);
    image::GrayImage::from_fn(n, n, texel).save(path).unwrap();
}

const EVEN: &str = "ambient = { irradiance_w_m2 = 0.3 }\n";
const TILTED: &str = "position_mm = [10, -5, 1000]\nrotation_deg = [20, -35, 15]\nalbedo = 0.8\n";

#[test]
fn checkerboard_matches_4096_samples_a_pixel() {
    let profile = Profile::load("pmp-bench").unwrap();
    let dir = tempfile::tempdir().unwrap();
    let n = 64;
    checkerboard(&dir.path().join("board.png"), n);
    let black = profile.camera.sensor.black_level_dn;
    let contrast = 0.8 * 0.3 * dn_per_irradiance(&profile, 8e-3);
    // Texel sizes from a third of a pixel (1.58 mm at 1000 mm) to four pixels.
    for texel_mm in [0.5, 1.9, 6.3] {
        let size = texel_mm * f64::from(n);
        let text = format!(
            "{EVEN}[[object]]\nshape = {{ kind = \"plane\" }}\n{TILTED}\
             texture = \"board.png\"\ntexture_size_mm = [{size}, {size}]\n"
        );
        let scene = scene(&text, dir.path());
        let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
        assert!(renderer.plan().has(Term::AlbedoMaps));
        let shot = Shot {
            pattern_image: None,
            ..white(&profile)
        };
        let found = renderer.expected_dn(&shot);
        let pose = scene.object[0].scene_from_object().inverse();
        let view = profile.camera.view();
        let mut worst = 0.0f64;
        for i in (0..found.len()).step_by(1871) {
            let px = DVec2::new((i % 1138) as f64, (i / 1138) as f64);
            let mut sum = 0.0;
            for k in 0..4096 {
                let inside = DVec2::new(f64::from(k % 64) + 0.5, f64::from(k / 64) + 0.5);
                let ray = view.ray(px + inside / 64.0 - 0.5);
                let (o, d) = (pose.translation_mm, pose.direction(ray));
                let p = o - d * (o.z / d.z);
                let cell = (DVec2::new(p.x, p.y) / texel_mm).floor();
                sum += (cell.x + cell.y).rem_euclid(2.0);
            }
            let exact = black + contrast * sum / 4096.0;
            worst = worst.max((f64::from(found[i]) - exact).abs());
        }
        assert!(
            worst < 0.04 * contrast,
            "{texel_mm} mm: {worst} DN of {contrast}"
        );
    }
}

#[test]
fn checkerboard_out_of_focus_matches_rays_through_the_pupil() {
    let mut profile = Profile::load("pmp-bench").unwrap();
    profile.camera.f_number = 1.0;
    profile.camera.height_px = 201;
    profile.camera.focus_mm = Some(700.0);
    let camera = &profile.camera;
    let (focus, pupil) = (700.0, camera.focal_length_mm / camera.f_number / 2.0);
    let dir = tempfile::tempdir().unwrap();
    let n = 64;
    checkerboard(&dir.path().join("board.png"), n);
    let black = camera.sensor.black_level_dn;
    let contrast = 0.8 * 0.001 * dn_per_irradiance(&profile, 8e-3);
    let texel_mm = 6.3;
    let size = texel_mm * f64::from(n);
    let text = format!(
        "ambient = {{ irradiance_w_m2 = 0.001 }}\n[[object]]\nshape = {{ kind = \"plane\" }}\n\
         {TILTED}texture = \"board.png\"\ntexture_size_mm = [{size}, {size}]\n"
    );
    let scene = scene(&text, dir.path());
    let options = Options {
        samples: 64,
        ..Options::default()
    };
    let mut renderer = Renderer::with_options(&profile, &scene, 1, options).unwrap();
    let shot = Shot {
        pattern_image: None,
        ..white(&profile)
    };
    let found = renderer.expected_dn(&shot);
    let pose = scene.object[0].scene_from_object().inverse();
    let view = profile.camera.view();
    let (mut squares, mut bias, mut spread, mut count) = (0.0, 0.0, 0.0, 0.0);
    for i in (0..found.len()).step_by(773) {
        let px = DVec2::new((i % 1138) as f64, (i / 1138) as f64);
        let mut sum = 0.0;
        for k in 0..4096 {
            let inside = DVec2::new(f64::from(k % 64) + 0.5, f64::from(k / 64) + 0.5);
            let ray = view.ray(px + inside / 64.0 - 0.5);
            let turn = (f64::from(k) * 2f64.sqrt()).fract() * 2.0 * PI;
            let radius = pupil * (f64::from(k) * 3f64.sqrt()).fract().sqrt();
            let from = (DVec2::from_angle(turn) * radius).extend(0.0);
            let (o, d) = (pose.point(from), pose.direction(ray / ray.z * focus - from));
            let p = o - d * (o.z / d.z);
            let cell = (DVec2::new(p.x, p.y) / texel_mm).floor();
            sum += (cell.x + cell.y).rem_euclid(2.0);
        }
        let exact = sum / 4096.0;
        let off = (f64::from(found[i]) - black) / contrast - exact;
        squares += off * off;
        bias += off;
        spread += (exact - 0.5).powi(2);
        count += 1.0;
    }
    let (rms, bias, spread): (f64, f64, f64) = (
        (squares / count).sqrt(),
        bias / count,
        (spread / count).sqrt(),
    );
    // The exact means vary little because the board is out of focus; in focus, their spread would
    // be 0.5.
    assert!(spread < 0.3, "{spread}");
    assert!(rms < 0.05 && bias.abs() < 0.005, "{rms} {bias}");
}

/// A texture stays on its object if the rig is rotated by 90 degrees about z and shifted; the poses
/// relative to the rig are computed by hand.
#[test]
fn textures_lie_on_their_objects_wherever_the_rig_stands() {
    let profile = Profile::load("pmp-bench").unwrap();
    let dir = tempfile::tempdir().unwrap();
    checkerboard(&dir.path().join("board.png"), 16);
    let seen = |rig: &str, position: &str, rotation: &str| {
        let text = format!(
            "{EVEN}{rig}[[object]]\nshape = {{ kind = \"sphere\", radius_mm = 200 }}\n\
             position_mm = {position}\nrotation_deg = {rotation}\nalbedo = 0.8\n\
             texture = \"board.png\"\ntexture_size_mm = [300, 300]\n"
        );
        let scene = scene(&text, dir.path());
        let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
        renderer.expected_dn(&white(&profile))
    };
    let here = seen("", "[30, 10, 900]", "[20, 35, 0]");
    let rig = "[rig]\nposition_mm = [100, -50, 200]\nrotation_deg = [0, 0, 90]\n";
    // Rotations are about fixed axes, about z last.
    let there = seen(rig, "[90, -20, 1100]", "[20, 35, 90]");
    let dark = profile.camera.sensor.black_level_dn as f32 + 1.0;
    assert!(here.iter().filter(|&&dn| dn > dark).count() > 10_000);
    for (i, (a, b)) in here.iter().zip(there).enumerate() {
        assert!((a - b).abs() < 0.02, "{i}: {a} {b}");
    }
}

#[test]
fn a_texture_by_the_meshs_coordinates_is_the_one_laid_over_the_plane() {
    let profile = Profile::load("pmp-bench").unwrap();
    let dir = tempfile::tempdir().unwrap();
    // This image differs from all its rotations and reflections.
    let picture = image::RgbImage::from_fn(7, 5, |x, y| {
        image::Rgb([(x * 36) as u8, (y * 60) as u8, ((x + 2 * y) * 15) as u8])
    });
    picture.save(dir.path().join("p.png")).unwrap();
    // A rectangle of 600 x 400 mm, defined once as a plane and once as a mesh.
    let corners = [
        (-300, -200, 0, 1),
        (300, -200, 1, 1),
        (300, 200, 1, 0),
        (-300, 200, 0, 0),
    ];
    let mut obj = String::new();
    let mut ply = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
                   property float z\nproperty float s\nproperty float t\nelement face 2\n\
                   property list uchar int vertex_indices\nend_header\n"
        .to_string();
    for (x, y, u, v) in corners {
        obj += &format!("v {x} {y} 0\nvt {u} {v}\n");
        ply += &format!("{x} {y} 0 {u} {v}\n");
    }
    obj += "f 1/1 2/2 3/3 4/4\n";
    ply += "3 0 1 2\n3 0 2 3\n";
    std::fs::write(dir.path().join("m.obj"), obj).unwrap();
    std::fs::write(dir.path().join("m.ply"), ply).unwrap();
    let image = |shape: &str, size: &str| {
        let text =
            format!("{EVEN}[[object]]\nshape = {{ {shape} }}\n{TILTED}texture = \"p.png\"\n{size}");
        let mut renderer = Renderer::new(&profile, &scene(&text, dir.path()), 1).unwrap();
        renderer.expected_dn(&white(&profile))
    };
    let plane = image(
        "kind = \"plane\", size_mm = [600, 400]",
        "texture_size_mm = [600, 400]\n",
    );
    let spread = plane.iter().copied().fold(0.0, f32::max);
    assert!(spread > 60.0, "{spread}");
    for file in ["m.obj", "m.ply"] {
        let mesh = image(&format!("kind = \"mesh\", file = \"{file}\""), "");
        let off = |(a, b): (&f32, &f32)| (a - b).abs();
        // Pixels at the rim of the rectangle have footprints that reach into the next copy of the
        // texture.
        let far = plane
            .iter()
            .zip(&mesh)
            .map(off)
            .filter(|&e| e > 1e-2)
            .count();
        assert!(far == 0, "{file}: {far} pixels");
    }
}

#[test]
fn vertex_colours_are_interpolated() {
    let profile = Profile::load("pmp-bench").unwrap();
    let dir = tempfile::tempdir().unwrap();
    let obj = "v -2000 -2000 0 1 1 1\nv 2000 -2000 0 1 0 0\nv 0 3000 0 0.5 0.5 0.5\nf 1 2 3\n";
    std::fs::write(dir.path().join("m.obj"), obj).unwrap();
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
               property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
               element face 1\nproperty list uchar int vertex_indices\nend_header\n\
               -2000 -2000 0 255 255 255\n2000 -2000 0 255 0 0\n0 3000 0 128 128 128\n3 0 1 2\n";
    std::fs::write(dir.path().join("m.ply"), ply).unwrap();
    // sRGB 0.5 and 128/255 converted to linear light by the standard's formula.
    let grey = |c: f64| ((c + 0.055) / 1.055).powf(2.4);
    for (file, third) in [("m.obj", grey(0.5)), ("m.ply", grey(128.0 / 255.0))] {
        let object =
            format!("{EVEN}[[object]]\nshape = {{ kind = \"mesh\", file = \"{file}\" }}\n{TILTED}");
        let scene = scene(&format!("{object}vertex_colours = true\n"), dir.path());
        let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
        let shot = Shot {
            pattern_image: None,
            ..white(&profile)
        };
        let found = renderer.expected_dn(&shot);
        let pose = scene.object[0].scene_from_object().inverse();
        let black = profile.camera.sensor.black_level_dn;
        let scale = 0.8 * 0.3 * dn_per_irradiance(&profile, 8e-3);
        let mut compared = 0;
        for i in (0..found.len()).step_by(37) {
            let ray = profile
                .camera
                .view()
                .ray(DVec2::new((i % 1138) as f64, (i / 1138) as f64));
            let (o, d) = (pose.translation_mm, pose.direction(ray));
            let p = o - d * (o.z / d.z);
            let c = (p.y + 2000.0) / 5000.0;
            let b = (p.x + 2000.0 - 2000.0 * c) / 4000.0;
            // At the triangle's own edge, the footprint also covers the empty background.
            if (1.0 - b - c).min(b).min(c) < 0.01 {
                continue;
            }
            compared += 1;
            let exact = black + scale * ((1.0 - b - c) + 0.2126 * b + third * c);
            assert!(
                (f64::from(found[i]) - exact).abs() < 2e-3,
                "{i}: {} {exact}",
                found[i]
            );
        }
        assert!(compared > 10_000, "{compared}");
        renderer.force(Term::AlbedoMaps, false);
        let plain = renderer.expected_dn(&shot);
        assert!(
            (f64::from(plain[0]) - black - scale).abs() < 2e-3,
            "without the term, the albedo is uniform"
        );
    }
}

#[test]
fn missing_textures_and_colours_are_refused_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let profile = Profile::load("webcam-grey").unwrap();
    std::fs::write(
        dir.path().join("m.obj"),
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    )
    .unwrap();
    std::fs::write(dir.path().join("no.png"), "no picture").unwrap();
    checkerboard(&dir.path().join("board.png"), 2);
    image::GrayImage::new(4097, 1)
        .save(dir.path().join("long.png"))
        .unwrap();
    let mesh = "shape = { kind = \"mesh\", file = \"m.obj\" }\nalbedo = 0.5\n";
    let plane = "shape = { kind = \"plane\" }\nalbedo = 0.5\n";
    let sized = "texture_size_mm = [9, 9]\n";
    for (object, says) in [
        (
            format!("{mesh}vertex_colours = true\n"),
            "object[0]: vertex_colours: a mesh without",
        ),
        (
            format!("{mesh}texture = \"board.png\"\n"),
            "a mesh without texture coordinates",
        ),
        (format!("{plane}texture = \"no.png\"\n{sized}"), "no.png"),
        (
            format!("{plane}texture = \"absent.png\"\n{sized}"),
            "absent.png",
        ),
        (
            format!("{plane}texture = \"long.png\"\n{sized}"),
            "4096 x 4096",
        ),
    ] {
        let scene = scene(&format!("[[object]]\n{object}"), dir.path());
        let error = Renderer::new(&profile, &scene, 1)
            .err()
            .expect("is refused");
        assert_eq!(error.exit_code(), 2, "{error}");
        assert!(error.to_string().contains(says), "{error}");
    }
    for (object, says) in [
        (
            format!("{plane}texture = \"board.png\"\n"),
            "object[0].texture: a texture without a size",
        ),
        (
            format!("{plane}{sized}"),
            "object[0].texture_size_mm: a size without a texture",
        ),
        (
            format!("{plane}texture = \"a.png\"\ntexture_size_mm = [0, 1]\n"),
            "texture_size_mm: 0",
        ),
        (
            format!("{plane}vertex_colours = true\n"),
            "object[0].vertex_colours",
        ),
        (
            format!("{plane}specular = {{ f0 = 1.5, roughness = 0.3 }}\n"),
            "specular.f0: 1.5",
        ),
        (
            format!("{plane}specular = {{ f0 = 0.5, roughness = 0 }}\n"),
            "0.05 to 1",
        ),
        (format!("{plane}specular = {{ f0 = 0.5 }}\n"), "roughness"),
    ] {
        let text = format!("name = \"s\"\ndescription = \"\"\n[[object]]\n{object}");
        let error = Scene::parse(&text, "s.toml").unwrap_err().to_string();
        assert!(
            error.contains(says) && error.starts_with("s.toml:"),
            "{error}"
        );
    }
}
