//! Exposure lengths, combination of motion with other terms, and rejected requests.

use crate::motion::still::{room, write_sheet};
use crate::motion::{MS, bench, fringe, instants, scene, shot};
use phasmid::emulator::render::{Options, Renderer};
use phasmid::emulator::{PatternImage, Shot};
use phasmid::geometry::{Mesh, ply, shapes};
use phasmid::profile::Scene;
use std::path::Path;
use std::sync::Arc;

#[test]
fn moving_scene_is_exposed_from_1_us_to_10_s() {
    let mut profile = bench();
    profile.projector.radiant_intensity_w_sr = 0.8;
    let (_, pattern_image) = fringe(&profile, 16.0, 0.4);
    // The sphere moves up and down by 20 mm within a second.
    let object = "shape = { kind = \"sphere\", radius_mm = 60.0 }\nalbedo = 0.5\n\
                  position_mm = [0, 0, 980]\nmotion = { period_s = 1.0, keyframes = [\n\
                  { time_s = 0.0 }, { time_s = 0.5, position_mm = [0, 0, -20] } ] }\n";
    let moving = room(object, Path::new(""));
    let white = Arc::new(PatternImage::Uniform(255));
    for exposure_ns in [1000, 50_000, 8 * MS, 200 * MS, 10_000 * MS] {
        let mut renderer = instants(&profile, &moving, 5);
        // With constant full light the pixels would saturate in long exposures.
        let light = 4e6 / exposure_ns as f64;
        let exposure = Shot {
            light: light.min(1.0),
            ..shot(&white, 77, exposure_ns)
        };
        let found = renderer.expected_dn(&exposure);
        assert!(found.iter().all(|v| v.is_finite()));
        // Shorter exposures may be too dark to show the sphere, because `light` is limited to 1.
        let middle = (77.0 + exposure_ns as f64 / 2.0) * 1e-9;
        let bright = found.iter().filter(|v| **v > 8.0).count();
        if exposure_ns >= 8 * MS {
            assert!(
                bright > 5000,
                "{exposure_ns} ns at {middle} s: {bright} pixels"
            );
        }
        let frame = renderer.expose(&Shot {
            pattern_image: Some(pattern_image.clone()),
            ..exposure
        });
        assert_eq!(frame.exposure_end_ns - frame.exposure_start_ns, exposure_ns);
    }
    // The last instants of device time need no special treatment.
    let mut renderer = instants(&profile, &moving, 4);
    let late = renderer.expected_dn(&shot(&white, u64::MAX - 5, 8 * MS));
    assert!(late.iter().all(|v| v.is_finite()));
}

#[test]
fn flicker_and_glare_go_through_the_instants() {
    let mut profile = bench();
    let lit = "ambient = { irradiance_w_m2 = 0.3, \
               flicker = { frequency_hz = 100, depth = 0.8, phase_deg = 40 } }\n\
               [[object]]\nshape = { kind = \"plane\" }\nposition_mm = [0, 0, 1100]\nalbedo = 0.4\n";
    // This sphere is behind the camera and therefore invisible.
    let behind = "[[object]]\nshape = { kind = \"sphere\", radius_mm = 5.0 }\nalbedo = 0.5\n\
                  motion = { keyframes = [ { time_s = 0.0, position_mm = [0, 0, -900] }, \
                  { time_s = 1.0, position_mm = [0, 0, -950] } ] }\n";
    let (_, pattern_image) = fringe(&profile, 16.0, 0.4);
    for glare in [
        None,
        Some(phasmid::profile::Glare {
            percent: 3.0,
            sigma_px: 40.0,
        }),
    ] {
        profile.camera.glare = glare;
        let still = scene(lit, Path::new(""));
        let moving = scene(&format!("{lit}{behind}"), Path::new(""));
        for exposure_ns in [1_234_567, 8 * MS] {
            let exposure = shot(&pattern_image, 3 * MS, exposure_ns);
            let a = instants(&profile, &still, 1).expected_dn(&exposure);
            let b = instants(&profile, &moving, 6).expected_dn(&exposure);
            let off = a
                .iter()
                .zip(&b)
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f32::max);
            assert!(off < 1e-3, "{off}");
        }
    }
}

#[test]
fn meshes_that_do_not_fit_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    write_sheet(&dir.path().join("a.obj"), 10.0);
    let torso = |triangles| {
        shapes::torso(&shapes::Torso {
            triangles,
            ..shapes::Torso::default()
        })
    };
    let write = |name: &str, mesh: &Mesh| ply::write_mesh(&dir.path().join(name), mesh).unwrap();
    let mut mesh = torso(2000);
    write("torso.ply", &mesh);
    write("few.ply", &torso(900));
    mesh.triangles[7].swap(0, 1);
    write("turned.ply", &mesh);
    for (second, needles) in [
        (
            "few.ply",
            vec![
                "keyframes[1].file",
                "few.ply",
                "vertices and",
                "as in the object's own",
            ],
        ),
        (
            "turned.ply",
            vec!["turned.ply: triangle 7", "as in the object's own mesh"],
        ),
        (
            "absent.ply",
            vec!["keyframes[1].file", "absent.ply", "an existing file"],
        ),
    ] {
        let text = format!(
            "[[object]]\nshape = {{ kind = \"mesh\", file = \"torso.ply\" }}\nalbedo = 0.5\n\
             deform = {{ keyframes = [ {{ time_s = 0, file = \"torso.ply\" }}, \
             {{ time_s = 1, file = \"{second}\" }} ] }}\n"
        );
        let refused = Renderer::new(&bench(), &scene(&text, dir.path()), 1);
        let error = refused.err().expect(second);
        assert_eq!(error.exit_code(), 2);
        let message = error.to_string();
        assert!(message.contains("scene, object[0]"), "{message}");
        for needle in needles {
            assert!(message.contains(needle), "{needle} is not in: {message}");
        }
    }
    let refuses = |options: Options, place: &str, expected: &str| {
        let scene = Scene::load("plane").unwrap();
        let refused = Renderer::with_options(&bench(), &scene, 1, options);
        let message = refused.err().unwrap().to_string();
        assert!(
            message.contains(place) && message.contains(expected),
            "{message}"
        );
    };
    for time_samples in [0, 257] {
        let options = Options {
            time_samples,
            ..Options::default()
        };
        refuses(options, "time samples", "1 to 256");
    }
    for motion_tolerance_px in [-0.01, 1.01, f64::NAN, f64::INFINITY] {
        let options = Options {
            motion_tolerance_px,
            ..Options::default()
        };
        refuses(options, "motion tolerance", "0 to 1 projector pixels");
    }
}

/// Motion of up to an eighth of a pixel is rendered at one instant, whatever number is requested,
/// and the result still equals the sum over many parts of the exposure. Larger motion is rendered at
/// several instants. Later rows count too: an object at rest during the first row's exposure may
/// move during the last row's.
#[test]
fn slow_motion_is_rendered_at_one_instant() {
    let profile = bench();
    let (_, pattern_image) = fringe(&profile, 16.0, 0.4);
    let mean = |mm: f64, from_s: f64| {
        let object = format!(
            "shape = {{ kind = \"sphere\", radius_mm = 60.0 }}\nalbedo = 0.5\nposition_mm = [0, 0, 980]\n\
             motion = {{ keyframes = [ {{ time_s = 0.0 }}, {{ time_s = {from_s} }},\n\
             {{ time_s = {}, position_mm = [{mm}, 0, 0] }} ] }}\n",
            from_s + 0.008
        );
        room(&object, Path::new(""))
    };
    let exposure = shot(&pattern_image, 0, 8 * MS);
    let expected = |scene: &Scene, time_samples, shot: &Shot| {
        instants(&profile, scene, time_samples).expected_dn(shot)
    };
    // A pixel covers 1.45 mm at the depth of the object.
    let slow = mean(0.15, 1e-5);
    let once = expected(&slow, 1, &exposure);
    assert_eq!(once, expected(&slow, 8, &exposure), "a tenth of a pixel");
    let black = profile.camera.sensor.black_level_dn as f32;
    let mut parts = instants(&profile, &slow, 1);
    let mut sum = vec![0.0f32; once.len()];
    for i in 0..16 {
        let part = shot(&pattern_image, i * MS / 2, MS / 2);
        let part = parts.expected_dn(&part);
        sum.iter_mut()
            .zip(part)
            .for_each(|(sum, dn)| *sum += dn - black);
    }
    let off = once
        .iter()
        .zip(&sum)
        .map(|(once, sum)| (once - black - sum).abs());
    let far = off.filter(|off| *off > 0.1).count();
    assert!(far < once.len() / 1000, "{far} of {}", once.len());
    let quick = mean(3.0, 1e-5);
    assert_ne!(
        expected(&quick, 1, &exposure),
        expected(&quick, 8, &exposure)
    );
    // The object rests for 20 ms and moves during the exposure of the last rows.
    let late = mean(3.0, 0.02);
    let mut rolling = exposure.clone();
    rolling.shutter.line_time_ns = 40_000;
    rolling.shutter.rows = profile.camera.height_px;
    assert_ne!(expected(&late, 1, &rolling), expected(&late, 8, &rolling));
}
