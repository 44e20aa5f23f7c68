//! Moving scenes compared with still scenes in the position that the moving scene has at that time.

use crate::motion::{MS, bench, fringe, instants, renderer, scene, shot};
use phasmid::emulator::render::{Options, Renderer, Term};
use phasmid::emulator::{Shot, Shutter, Truth};
use phasmid::profile::{Profile, Scene};
use std::fmt::Write;
use std::path::Path;

/// Writes a sheet that bulges towards the camera, with vertex colours.
pub fn write_sheet(path: &Path, bulge: f64) {
    let n = 40;
    let mut text = String::new();
    for j in 0..=n {
        for i in 0..=n {
            let (x, y) = (f64::from(i) * 5.0 - 100.0, f64::from(j) * 5.0 - 100.0);
            let z = -bulge * (-(x * x + y * y) / 3000.0).exp() - 0.05 * x;
            let grey = 0.5 + 0.4 * (x / 17.0).sin() * (y / 23.0).cos();
            writeln!(text, "v {x:?} {y:?} {z:?} {grey} {grey} {grey}").unwrap();
        }
    }
    let at = |i: i32, j: i32| j * (n + 1) + i + 1;
    for j in 0..n {
        for i in 0..n {
            let [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
            writeln!(text, "f {a} {b} {c}\nf {a} {c} {d}").unwrap();
        }
    }
    std::fs::write(path, text).unwrap();
}

/// Returns a scene with lamps, a floor and an object in front of the floor.
pub fn room(object: &str, folder: &Path) -> Scene {
    scene(
        &format!(
            "ambient = {{ irradiance_w_m2 = 0.02 }}\n\
             [[light]]\nkind = \"point\"\nposition_mm = [-300, -200, 100]\nintensity_w_sr = 0.05\n\
             [[light]]\nkind = \"directional\"\ndirection = [0.3, 0.2, 1]\nirradiance_w_m2 = 0.03\n\
             [[object]]\nshape = {{ kind = \"plane\" }}\nposition_mm = [0, 0, 1100]\nalbedo = 0.4\n\
             [[object]]\nshape = {{ kind = \"torso\", triangles = 2000 }}\nscale = 0.2\n\
             position_mm = [-120, 60, 1100]\nalbedo = 0.3\n\
             [[object]]\n{object}"
        ),
        folder,
    )
}

/// Writes a chequered image.
fn write_checker(path: &Path) {
    let level = |x: u32, y: u32| image::Luma([if (x + y).is_multiple_of(2) { 230u8 } else { 90 }]);
    image::GrayImage::from_fn(8, 8, level).save(path).unwrap();
}

/// Returns the number of bytes that differ between two frames.
fn apart(a: &[u8], b: &[u8]) -> usize {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).filter(|(a, b)| a != b).count()
}

/// Compares frame and truth of a moving and a still scene at an instant at which the two coincide.
fn same(profile: &Profile, still: &Scene, moving: &Scene, time_ns: u64, what: &str) {
    let (_, pattern_image) = fringe(profile, 16.0, 0.4);
    let exposure = shot(&pattern_image, time_ns - 4 * MS, 8 * MS);
    let mut rest = instants(profile, still, 1);
    let mut moved = instants(profile, moving, 1);
    assert!(moved.plan().has(Term::Motion) && !rest.plan().has(Term::Motion));
    let (a, b) = (rest.expose(&exposure).data, moved.expose(&exposure).data);
    // A triangle transformed in two frames of reference is the same in f64 except for its last
    // digits; f32 rounds some of them differently.
    let off = apart(&a, &b);
    assert!(off <= 3, "{what}: {off} bytes");
    assert!(a.iter().collect::<std::collections::HashSet<_>>().len() > 100);
    let (a, b) = (rest.truth(&[]), moved.truth_at(&[], time_ns));
    let mut seen = 0;
    for i in 0..a.flags.len() {
        assert_eq!(a.flags[i], b.flags[i] & !Truth::MOVING, "{what} {i}");
        seen += usize::from(b.flags[i] & Truth::MOVING != 0);
        if a.flags[i] & Truth::SEEN != 0 {
            let off = (a.depth_mm[i] - b.depth_mm[i]).abs();
            assert!(off <= 1e-4, "{what} {i}: {off}");
        }
    }
    let part = seen as f64 / a.flags.len() as f64;
    assert!((0.003..0.5).contains(&part), "{what}: {part} moves");
}

#[test]
fn moving_object_looks_like_a_still_one_at_its_place() {
    let dir = tempfile::tempdir().unwrap();
    write_sheet(&dir.path().join("sheet.obj"), 30.0);
    write_checker(&dir.path().join("checker.png"));
    let looks = "albedo = 0.8\nspecular = { f0 = 0.04, roughness = 0.4 }\n\
                 texture = \"checker.png\"\ntexture_size_mm = [160.0, 160.0]\n";
    let mut profile = bench();
    profile.camera.height_px = 243;
    for (shape, more) in [
        (
            "kind = \"mesh\", file = \"sheet.obj\"",
            "vertex_colours = true\n",
        ),
        ("kind = \"sphere\", radius_mm = 50.0", ""),
        (
            "kind = \"cylinder\", radius_mm = 30.0, length_mm = 90.0",
            "",
        ),
        ("kind = \"torso\", triangles = 3000", "scale = 0.4\n"),
    ] {
        let object = |place: &str| {
            let text = format!("shape = {{ {shape} }}\n{looks}{more}{place}\n");
            room(&text, dir.path())
        };
        // The object is halfway through a uniform rotation and translation about its own origin.
        let still = object("position_mm = [30, -20, 1000]\nrotation_deg = [0, 0, 30]");
        let moving = object(
            "position_mm = [0, 0, 1000]\nmotion = { keyframes = [\n\
             { time_s = 1.0, position_mm = [10, 20, 40], rotation_deg = [0, 0, 10] },\n\
             { time_s = 3.0, position_mm = [50, -60, -40], rotation_deg = [0, 0, 50] } ] }",
        );
        same(&profile, &still, &moving, 2_000_000_000, shape);
        // The keyframe's pose applies first, then the object's rest position.
        let still = object("position_mm = [30, -20, 1000]\nrotation_deg = [20, 0, 0]");
        let moving = object(
            "position_mm = [30, -20, 980]\nmotion = { period_s = 4.0, keyframes = [\n\
             { time_s = 0.5 }, { time_s = 1.25, position_mm = [0, 0, 20], rotation_deg = [20, 0, 0] },\n\
             { time_s = 3.0, position_mm = [9, 0, 0] } ] }",
        );
        same(&profile, &still, &moving, 41_250_000_000, shape);
    }
}

#[test]
fn a_row_of_a_rolling_shutter_is_that_of_a_global_one_at_its_time() {
    let dir = tempfile::tempdir().unwrap();
    for (name, bulge) in [("out", 40.0), ("in", 10.0)] {
        write_sheet(&dir.path().join(format!("{name}.obj")), bulge);
    }
    let way = "motion = { keyframes = [ { time_s = 0.0 }, \
               { time_s = 0.1, position_mm = [40, 10, -60], rotation_deg = [0, 0, 25] } ] }";
    let breath = "deform = { keyframes = [ { time_s = 0.0, file = \"in.obj\" }, \
                  { time_s = 0.1, file = \"out.obj\" } ] }";
    let object = |more: &str| {
        let text = format!(
            "shape = {{ kind = \"mesh\", file = \"in.obj\" }}\nalbedo = 0.8\n\
             vertex_colours = true\nposition_mm = [0, 0, 1000]\n{more}\n"
        );
        room(&text, dir.path())
    };
    let mut profile = bench();
    profile.camera.height_px = 163;
    profile.camera.line_time_us = 90.0;
    let line_time_ns = 90_000;
    let (_, pattern_image) = fringe(&profile, 16.0, 0.4);
    let rolling = Shot {
        shutter: Shutter {
            line_time_ns,
            first_row: 0,
            rows: profile.camera.height_px,
        },
        ..shot(&pattern_image, 20 * MS, 8 * MS)
    };
    let width = profile.camera.width_px as usize;
    // A deforming mesh takes on sixteen shapes in the 15 ms of a frame. The error is at most half a
    // millisecond, or 0.15 mm at the top of the bulge.
    for (more, samples, bar) in [(way, 1, 2e-3), (way, 16, 2e-3), (breath, 1, 6.0)] {
        let options = Options {
            samples,
            time_samples: 2,
            ..Options::default()
        };
        let scene = object(more);
        let mut renderer = Renderer::with_options(&profile, &scene, 1, options).unwrap();
        let rolled = renderer.expected_dn(&rolling);
        let mut global = Renderer::with_options(&profile, &scene, 1, options).unwrap();
        global.force(Term::RollingShutter, false);
        let early = global.expected_dn(&rolling);
        for row in [0, 57, 81, 110] {
            let exposed = Shot {
                start_ns: rolling.start_ns + row as u64 * line_time_ns,
                ..rolling.clone()
            };
            let all = global.expected_dn(&exposed);
            let of = |frame: &[f32]| frame[row * width..][..width].to_vec();
            let off = |other: &[f32]| {
                let pairs = of(&rolled).into_iter().zip(of(other));
                pairs.filter(|(a, b)| (a - b).abs() > bar).count()
            };
            // At edges, neighbouring rows decide which pixels are sampled.
            assert!(off(&all) <= 6, "{more} {samples} {row}: {}", off(&all));
            if row == 81 && bar < 1.0 {
                assert!(
                    off(&early) > 100,
                    "{row}: the object has moved: {}",
                    off(&early)
                );
            }
        }
    }
}

#[test]
fn a_mesh_that_deforms_is_its_keyframe_and_half_way_their_mean() {
    let dir = tempfile::tempdir().unwrap();
    for (name, bulge) in [("rest", 10.0), ("out", 45.0), ("in", 5.0), ("mean", 25.0)] {
        write_sheet(&dir.path().join(format!("{name}.obj")), bulge);
    }
    let profile = bench();
    let object = |file: &str, more: &str| {
        let text = format!(
            "shape = {{ kind = \"mesh\", file = \"{file}.obj\" }}\nalbedo = 0.8\n\
             vertex_colours = true\nspecular = {{ f0 = 0.04, roughness = 0.4 }}\n\
             position_mm = [0, 0, 1000]\nrotation_deg = [0, 10, 0]\nscale = 0.8\n{more}\n"
        );
        room(&text, dir.path())
    };
    let breathing = object(
        "rest",
        "deform = { keyframes = [ { time_s = 1.0, file = \"in.obj\" }, \
         { time_s = 3.0, file = \"out.obj\" } ] }",
    );
    for (file, time_s) in [("in", 1), ("mean", 2), ("out", 3), ("out", 900)] {
        let still = object(file, "");
        same(&profile, &still, &breathing, time_s * 1_000_000_000, file);
    }
    // The mesh may also move as a whole; its texture then moves with the triangles.
    write_checker(&dir.path().join("checker.png"));
    let laid = "texture = \"checker.png\"\ntexture_size_mm = [160.0, 160.0]\n";
    let still = object(
        "out",
        &format!("{laid}\nmotion = {{ keyframes = [ {{ time_s = 0.0 }}, {{ time_s = 1.0 }} ] }}"),
    );
    let both = object(
        "rest",
        &format!(
            "{laid}motion = {{ keyframes = [ {{ time_s = 0.0, position_mm = [40, 0, 0] }}, {{ time_s = 3.0 }} ] }}\n\
             deform = {{ period_s = 8.0, keyframes = [ {{ time_s = 1.0, file = \"in.obj\" }}, \
             {{ time_s = 3.0, file = \"out.obj\" }} ] }}"
        ),
    );
    let (_, pattern_image) = fringe(&profile, 16.0, 0.4);
    let exposure = shot(&pattern_image, 2_996 * MS, 8 * MS);
    let a = instants(&profile, &still, 1).expose(&exposure).data;
    let b = instants(&profile, &both, 1).expose(&exposure).data;
    // The sheet deforms only along z, so a texture projected along z stays in place.
    let off = apart(&a, &b);
    assert!(off < 20, "{off} bytes");
}

#[test]
fn object_at_rest_with_a_motion_keeps_every_byte() {
    let mut profile = bench();
    profile.camera.sensor.noiseless = false;
    let folder = Path::new("");
    let object = |more: &str| {
        let text = format!(
            "shape = {{ kind = \"torso\", triangles = 9000 }}\nalbedo = 0.6\nscale = 0.5\n{more}\n"
        );
        room(&text, folder)
    };
    let place = "position_mm = [10, 0, 1080]";
    let (_, pattern_image) = fringe(&profile, 16.0, 0.4);
    let exposure = shot(&pattern_image, 500 * MS, 8 * MS);
    let still = Renderer::new(&profile, &object(place), 3)
        .unwrap()
        .expose(&exposure);
    // After its last keyframe the object rests. All instants of the exposure are then the same, so
    // only one is rendered.
    let held = object(
        "motion = { keyframes = [ { time_s = 0.1 }, \
         { time_s = 0.4, position_mm = [10, 0, 1080] } ] }",
    );
    let mut held = renderer(&profile, &held, 4, 3);
    let off = apart(&still.data, &held.expose(&exposure).data);
    assert!(off <= 3, "{off}");
    assert!(!held.prepare(), "the geometry is already computed");
    // A scene without motion is rendered at one instant even if more are requested.
    let mut forced = renderer(&profile, &object(place), 7, 3);
    forced.force(Term::Motion, true);
    assert_eq!(still.data, forced.expose(&exposure).data);
}
