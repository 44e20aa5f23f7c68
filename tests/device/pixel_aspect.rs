//! Lenses whose focal lengths fx and fy differ: pixels that are not square.

use crate::photometry;
use glam::DVec2;
use phasmid::emulator::render::Options;
use phasmid::emulator::render::reference::Reference;
use phasmid::emulator::render::{Renderer, Term};
use phasmid::emulator::{PatternImage, Shot, Truth};
use phasmid::pattern::{Axis, Pattern};
use phasmid::profile::{Focus, Glare, Profile, Scene, Vignetting, profile_text};
use phasmid::study::scanned::{Stage, scored};
use std::path::Path;
use std::sync::Arc;

const SIZE: [u32; 2] = [400, 240];

/// Returns the central part of the bench of Wu et al., with these pixel aspects of camera and
/// projector.
fn bench(camera: f64, projector: f64) -> Profile {
    let mut profile = Profile::load("pmp-bench").unwrap();
    profile.camera.sensor_width_mm *= f64::from(SIZE[0]) / f64::from(profile.camera.width_px);
    [profile.camera.width_px, profile.camera.height_px] = SIZE;
    profile.camera.principal_point_px = None;
    profile.camera.pixel_aspect = camera;
    profile.projector.pixel_aspect = projector;
    profile
}

fn tilted_plane() -> Scene {
    photometry::scene(
        "[[object]]\nshape = { kind = \"plane\" }\nposition_mm = [0, 0, 1000]\n\
         rotation_deg = [24, -13, 0]\nalbedo = 0.8\n",
        Path::new("."),
    )
}

/// Returns the text of a built-in profile with an aspect in one of its tables.
fn with_aspect(table: &str, aspect: &str) -> String {
    let header = format!("[{table}]\n");
    let text = profile_text("pmp-bench").unwrap();
    assert!(text.contains(&header));
    text.replace(&header, &format!("{header}pixel_aspect = {aspect}\n"))
}

#[test]
fn pixel_aspect_is_fy_over_fx_of_the_rig() {
    let square = bench(1.0, 1.0).nominal_rig();
    for lens in [square.camera.lens, square.projector.lens] {
        assert_eq!(lens.focal_px.x, lens.focal_px.y);
    }
    let rig = bench(1.05, 0.97).nominal_rig();
    for (lens, square, aspect) in [
        (rig.camera.lens, square.camera.lens, 1.05),
        (rig.projector.lens, square.projector.lens, 0.97),
    ] {
        assert_eq!(lens.focal_px.x, square.focal_px.x);
        assert!((lens.focal_px.y / lens.focal_px.x - aspect).abs() < 1e-15);
    }
}

#[test]
fn pixel_aspect_is_read_from_the_profile() {
    for table in ["camera", "projector"] {
        let profile = Profile::parse(&with_aspect(table, "1.05"), "file.toml").unwrap();
        let found = [profile.camera.pixel_aspect, profile.projector.pixel_aspect];
        let wanted = [1.05, 1.0];
        assert!(found == wanted || table == "projector" && found == [1.0, 1.05]);
    }
}

#[test]
fn rejects_pixel_aspect_out_of_range_with_its_line() {
    for table in ["camera", "projector"] {
        for aspect in ["0.49", "2.01", "-1.0", "0.0", "nan"] {
            let text = with_aspect(table, aspect);
            let at = text.find("pixel_aspect").unwrap();
            let line = 1 + text[..at].matches('\n').count();
            let message = Profile::parse(&text, "file.toml").unwrap_err().to_string();
            for needle in [
                format!("file.toml:{line}"),
                format!("{table}.pixel_aspect"),
                "0.5 to 2".to_owned(),
            ] {
                assert!(message.contains(&needle), "{needle:?} is not in: {message}");
            }
        }
    }
}

/// Frames decode with the exact rig as accurately as frames of square pixels.
#[test]
fn decoded_depth_is_as_accurate_as_with_square_pixels() {
    let scene = tilted_plane();
    let [square, other] = [(1.0, 1.0), (1.05, 0.97)].map(|(camera, projector)| {
        let profile = bench(camera, projector);
        let mut stage = Stage::new(&profile, &scene, 3, Options::default()).unwrap();
        let scanned = stage.scan(0).unwrap();
        let (_, score) = scored(&scanned, &stage.truth()).unwrap();
        println!("{camera} {projector}: {score:?}");
        assert!(score.coverage > 0.99 && score.gross_error_rate == 0.0);
        assert!(score.ratio_to_bound < 1.15);
        score
    });
    assert!((other.mae_mm / square.mae_mm - 1.0).abs() < 0.08);
}

/// Truth and light agree with the slow reference renderer if fx and fy differ strongly. This covers
/// pixel areas, vignetting, footprints, and the projector's blur along both axes.
#[test]
fn truth_and_grey_levels_agree_with_the_reference() {
    let mut profile = bench(1.4, 0.7);
    profile.camera.vignetting = Vignetting {
        natural: true,
        falloff: [-0.2, 0.05, 0.0],
    };
    profile.projector.vignetting = Vignetting {
        natural: true,
        falloff: [-0.3, 0.1, 0.0],
    };
    profile.camera.distortion = [-0.12, 0.05, 8e-4, -5e-4, 0.0];
    profile.projector.distortion = [-0.05, 0.02, -4e-4, 6e-4, 0.0];
    profile.projector.focus = Some(Focus {
        distance_mm: 900.0,
        aperture_mm: 14.0,
    });
    let scene = tilted_plane();
    compare(&profile, &scene);
    // The same camera with depth of field.
    profile.camera.distortion = [0.0; 5];
    profile.camera.focus_mm = Some(700.0);
    profile.camera.exposure_us *= (4.0 / profile.camera.f_number).powi(2);
    profile.camera.f_number = 4.0;
    profile.projector.focus = None;
    compare(&profile, &scene);
}

fn compare(profile: &Profile, scene: &Scene) {
    let reference = Reference::new(profile, scene).unwrap();
    let mut renderer = Renderer::new(profile, scene, 1).unwrap();
    let truth = renderer.truth(&[]);
    let seconds = profile.camera.exposure_us * 1e-6;
    let fringe = |axis, period_px| Pattern::Fringe {
        axis,
        period_px,
        phase_rad: 0.7,
    };
    for pattern in [
        Pattern::White {},
        fringe(Axis::X, 24.0),
        fringe(Axis::Y, 24.0),
    ] {
        let image = PatternImage::new(&pattern, &profile.projector, &|_| unreachable!()).unwrap();
        let shot = Shot {
            id: 1,
            noise_id: 1,
            pattern_image: Some(Arc::new(image.clone())),
            light: 1.0,
            exposure_ns: (seconds * 1e9) as u64,
            ..Shot::default()
        };
        let fast = renderer.expected_dn(&shot);
        let (mut worst, mut brightest, mut lit) = (0.0f64, 0.0f32, 0);
        for k in 0..25 {
            let (u, v) = (8 + k % 5 * 95, 6 + k / 5 * 56);
            let i = v * SIZE[0] as usize + u;
            let px = DVec2::new(u as f64, v as f64);
            let found = reference.trace(px).unwrap();
            assert_eq!(truth.flags[i] & Truth::LIT != 0, found.lit, "({u}, {v})");
            // Sixteen samples per pixel resolve an edge to a few per cent.
            if !found.lit || truth.flags[i] & Truth::CREASE != 0 {
                continue;
            }
            lit += 1;
            let told = DVec2::new(truth.projector_x[i].into(), truth.projector_y[i].into());
            assert!((told - found.projector_px).abs().max_element() < 2e-3);
            assert!((f64::from(truth.depth_mm[i]) - found.point.z).abs() < 1e-3);
            let slow = reference.signal_dn(px, &image, seconds, 16384);
            worst = worst.max((f64::from(fast[i]) - slow).abs());
            brightest = brightest.max(fast[i]);
        }
        println!("{pattern:?}: {worst:.3} of {brightest:.0} DN, {lit} points");
        assert!(lit >= 15 && brightest > 30.0 && brightest < 250.0);
        // The sampling error of the reference renderer is 0.02 to 0.05 DN.
        assert!(worst < 0.1, "{pattern:?}: {worst} DN");
    }
}

/// On the sensor, glare is as wide in millimetres along columns as along rows.
#[test]
fn glare_is_isotropic_on_the_sensor() {
    let mut profile = bench(2.0, 1.0);
    profile.camera.glare = Some(Glare {
        percent: 20.0,
        sigma_px: 32.0,
    });
    // A small bright patch in the centre of a dark field: 20 x 40 pixels, 20 pixel widths square.
    let [fx, fy] = profile.nominal_rig().camera.lens.focal_px.to_array();
    assert!((fy / fx - 2.0).abs() < 1e-12);
    let side = 20.0 * 1000.0 / fx;
    let scene = photometry::scene(
        &format!(
            "[[object]]\nshape = {{ kind = \"plane\", size_mm = [{side}, {side}] }}\n\
             position_mm = [0, 0, 1000]\nalbedo = 0.8\n"
        ),
        Path::new("."),
    );
    let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
    assert!(renderer.plan().has(Term::Glare));
    let shot = Shot {
        id: 1,
        noise_id: 1,
        pattern_image: Some(Arc::new(PatternImage::Uniform(255))),
        light: 1.0,
        exposure_ns: 8_000_000,
        ..Shot::default()
    };
    let dn = renderer.expected_dn(&shot);
    let black = profile.camera.sensor.black_level_dn;
    let at = |u: usize, v: usize| f64::from(dn[v * SIZE[0] as usize + u]) - black;
    let (right, below) = (at(230, 120), at(200, 180));
    println!("{right} {below} of {}", at(200, 120));
    assert!(right > 0.05 && (below / right - 1.0).abs() < 0.1);
}
