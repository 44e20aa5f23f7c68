//! Several rays per pixel, and rays through the whole pupil.

use super::closed_form::Rig;
use super::exact::plane;
use super::hold::{bench, scene};
use glam::DVec2;
use phasmid::emulator::render::reference::Reference;
use phasmid::emulator::render::{Options, Renderer, Term};
use phasmid::emulator::{PatternImage, Shot, Truth};
use phasmid::pattern::{Axis, Pattern};
use phasmid::profile::{Profile, Scene};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

fn shot(pattern_image: PatternImage, light: f64) -> Shot {
    Shot {
        id: 1,
        noise_id: 1,
        pattern_image: Some(Arc::new(pattern_image)),
        light,
        exposure_ns: 8_000_000,
        ..Shot::default()
    }
}

fn renderer(profile: &Profile, scene: &Scene, samples: u32) -> Renderer {
    Renderer::with_options(
        profile,
        scene,
        1,
        Options {
            samples,
            ..Options::default()
        },
    )
    .unwrap()
}

/// Returns the signal of each pixel with ambient light only.
fn ambient(profile: &Profile, scene: &Scene, samples: u32) -> Vec<f64> {
    let dark = shot(PatternImage::Uniform(0), 0.0);
    let signal = renderer(profile, scene, samples).expected_dn(&dark);
    signal.into_iter().map(f64::from).collect()
}

/// Returns a scene with a plate in front of a wall, both perpendicular to the camera's axis. The
/// plate covers the columns from `left` to `right`.
fn plate(profile: &Profile, left: f64, right: f64, [plate_mm, wall_mm]: [f64; 2]) -> Scene {
    let lens = profile.camera.view().lens;
    let x = |u: f64| (u - lens.principal_px.x) / lens.focal_px.x * plate_mm;
    let text = format!(
        "name = \"s\"\ndescription = \"\"\nambient = {{ irradiance_w_m2 = 0.5 }}\n\
         [[object]]\nshape = {{ kind = \"plane\" }}\nposition_mm = [0, 0, {wall_mm:?}]\n\
         albedo = 0.2\n[[object]]\n\
         shape = {{ kind = \"plane\", size_mm = [{:?}, 4000.0] }}\n\
         position_mm = [{:?}, 0, {plate_mm:?}]\nalbedo = 0.8\n",
        x(right) - x(left),
        x((left + right) / 2.0)
    );
    Scene::parse(&text, "s").unwrap()
}

#[test]
fn a_sliver_that_no_centre_sees_is_found_by_more_samples() {
    let profile = bench();
    // The plate covers a fifth of column 600, to the right of the column's centre.
    let scene = plate(&profile, 600.204, 600.396, [990.0, 1000.0]);
    let shares = |samples: u32| {
        let signal = ambient(&profile, &scene, samples);
        [3, 200, 480].map(|row| {
            let (wall, seen) = (signal[row * 1138 + 300], signal[row * 1138 + 600]);
            // The plate is four times as bright.
            (seen - wall) / (3.0 * (wall - profile.camera.sensor.black_level_dn))
        })
    };
    assert_eq!(shares(1), [0.0; 3]);
    for samples in [4, 16] {
        let found = shares(samples);
        let met = found.iter().all(|f| (f - 3.0 / 16.0).abs() < 1e-4);
        assert!(met, "{samples}: {found:?}");
    }
    let found = shares(64);
    assert!(
        found.iter().all(|f| (f - 0.192).abs() < 0.01),
        "64: {found:?}"
    );
}

#[test]
fn more_samples_do_not_change_closed_form_pixels() {
    for distortion in [[0.0; 5], [-0.12, 0.05, 8e-4, -5e-4, -0.004]] {
        let mut profile = bench();
        profile.camera.height_px = 121;
        profile.camera.distortion = distortion;
        let scene = scene(&plane(20.0, 1000.0));
        let fringe = Pattern::Fringe {
            axis: Axis::X,
            period_px: 16.0,
            phase_rad: 0.4,
        };
        let pattern_image =
            PatternImage::new(&fringe, &profile.projector, &|_| unreachable!()).unwrap();
        let shot = shot(pattern_image, 1.0);
        let mut lean = renderer(&profile, &scene, 1);
        let one = lean.expected_dn(&shot);
        let few = lean.truth(&[]).flags;
        for samples in [4, 16, 64] {
            let mut renderer = renderer(&profile, &scene, samples);
            let more = renderer.expected_dn(&shot);
            let flags = renderer.truth(&[]).flags;
            let creases = flags.iter().filter(|&f| f & Truth::CREASE != 0).count();
            assert!(creases < 5000, "only the field's border: {creases}");
            for (i, (a, b)) in one.iter().zip(&more).enumerate() {
                // At the edge of the projector's field, a single ray misses corners of pixels, and
                // 64 rays see more of them than sixteen.
                let crease = |flags: &[u8]| flags[i] & Truth::CREASE != 0;
                if !crease(&flags) || (samples < 64 && crease(&few)) {
                    assert!((a - b).abs() < 0.02, "{samples} at {i}: {a} {b}");
                }
            }
        }
    }
}

#[test]
fn numbers_of_samples_that_make_no_grid_are_refused() {
    let (profile, scene) = (bench(), Scene::load("plane").unwrap());
    for samples in [0, 2, 15, 17, 256, u32::MAX] {
        let refused = Renderer::with_options(
            &profile,
            &scene,
            1,
            Options {
                samples,
                ..Options::default()
            },
        );
        let message = refused.err().map(|e| e.to_string()).unwrap_or_default();
        assert!(message.contains("1, 4, 16 or 64"), "{samples}: {message}");
    }
}

/// Returns a profile with a strongly blurring lens, whose pupil diameter is 20 mm / 2 = 10 mm.
fn blurred(focus_mm: f64) -> Profile {
    let mut profile = bench();
    profile.camera.height_px = 201;
    profile.camera.f_number = 2.0;
    profile.camera.sensor.full_well_e = 1e9;
    profile.camera.sensor.gain_dn_per_e = 1e-4;
    profile.camera.focus_mm = Some(focus_mm);
    profile
}

/// Returns the radius in pixels of the blur disc of a point at depth z, from similar triangles.
fn disc_px(profile: &Profile, z_mm: f64) -> f64 {
    let camera = &profile.camera;
    let pupil_mm = camera.focal_length_mm / camera.f_number;
    let focus_mm = camera.focus_mm.unwrap();
    // Diameter of the pencil of rays from the point, first in the focal plane and then on the
    // sensor.
    let there_mm = pupil_mm * (z_mm - focus_mm).abs() / z_mm;
    let pixel_mm = camera.sensor_width_mm / f64::from(camera.width_px);
    there_mm * camera.focal_length_mm / focus_mm / pixel_mm / 2.0
}

/// Returns the fraction of a unit disc to the left of t, which is a circular segment.
fn segment(t: f64) -> f64 {
    let t = t.clamp(-1.0, 1.0);
    0.5 + (t * (1.0 - t * t).sqrt() + t.asin()) / PI
}

#[test]
fn edge_out_of_focus_spreads_by_the_disc_of_confusion() {
    // The wall, the plate or neither is in focus.
    for (focus_mm, plate_mm) in [(1000.0, 700.0), (1000.0, 950.0), (820.0, 700.0)] {
        let profile = blurred(focus_mm);
        let edge = 570.3;
        let scene = plate(&profile, -9000.0, edge, [plate_mm, 1000.0]);
        let radius = disc_px(&profile, plate_mm);
        assert!(radius > 0.1, "{radius}");
        for samples in [1, 64] {
            let signal = ambient(&profile, &scene, samples);
            let level = |column: usize, row: usize| {
                let wall = profile.camera.sensor.black_level_dn
                    + (signal[row * 1138 + 1100] - profile.camera.sensor.black_level_dn);
                (signal[row * 1138 + column] - wall) / (signal[row * 1138 + 20] - wall)
            };
            let (mut worst, mut bias) = (0.0f64, 0.0f64);
            for column in 540..601 {
                // The blur disc convolved with the width of the pixel.
                let n = 100;
                let exact = (0..n)
                    .map(|i| (f64::from(i) + 0.5) / f64::from(n) - 0.5)
                    .map(|s| segment((edge - (column as f64 + s)) / radius))
                    .sum::<f64>()
                    / f64::from(n);
                let errors: Vec<_> = (0..201).map(|row| level(column, row) - exact).collect();
                let mean = errors.iter().sum::<f64>() / errors.len() as f64;
                bias = bias.max(mean.abs());
                worst = errors.iter().fold(worst, |m, e| m.max(e.abs()));
            }
            // The samples are sparse in four dimensions, two of the pixel and two of the pupil.
            // Single pixels therefore scatter, but their mean does not.
            let bar = if samples == 64 { 0.11 } else { 0.24 };
            assert!(
                worst < bar && bias < 0.02,
                "focus {focus_mm}, plate {plate_mm}, {samples}: {worst} {bias}"
            );
        }
    }
}

/// Returns the Bessel function J1 by its integral (DLMF 10.9.2).
fn j1(x: f64) -> f64 {
    let n = 2000;
    (0..n)
        .map(|i| PI * (f64::from(i) + 0.5) / f64::from(n))
        .map(|t| (t - x * t.sin()).cos())
        .sum::<f64>()
        / f64::from(n)
}

#[test]
fn a_fringe_on_a_plane_out_of_focus_loses_the_disc_s_contrast() {
    let sharp = Profile {
        camera: phasmid::profile::Camera {
            focus_mm: None,
            ..blurred(1000.0).camera
        },
        ..blurred(1000.0)
    };
    let profile = blurred(800.0);
    let surface = plane(0.0, 1000.0);
    let scene = scene(&surface);
    for period_px in [40.0, 64.0, 160.0] {
        let sequence: Vec<_> = (0..4)
            .map(|k| {
                let pattern = Pattern::Fringe {
                    axis: Axis::X,
                    period_px,
                    phase_rad: TAU * f64::from(k) / 4.0,
                };
                let pattern_image =
                    PatternImage::new(&pattern, &profile.projector, &|_| unreachable!()).unwrap();
                (pattern, shot(pattern_image, 1.0))
            })
            .collect();
        let modulation = |profile: &Profile| {
            let mut renderer = renderer(profile, &scene, 1);
            assert_eq!(
                renderer.plan().has(Term::DepthOfField),
                profile.camera.focus_mm.is_some()
            );
            renderer.truth(&sequence)
        };
        let (before, after) = (modulation(&sharp), modulation(&profile));
        let rig = Rig::new(&profile);
        let mut compared = 0;
        for i in (0..after.flags.len()).step_by(101) {
            if after.flags[i] & (Truth::LIT | Truth::CREASE) != Truth::LIT {
                continue;
            }
            compared += 1;
            let px = DVec2::new((i % 1138) as f64, (i / 1138) as f64);
            let x = |px| rig.lit_from(&surface, px).unwrap().x;
            let by = |axis: DVec2| x(px + axis * 0.5) - x(px - axis * 0.5);
            let rho = disc_px(&profile, 1000.0) * by(DVec2::X).hypot(by(DVec2::Y));
            // Contrast under a disc (Goodman: "Introduction to Fourier Optics", section 6.4).
            let k = TAU * rho / period_px;
            let exact = 2.0 * j1(k) / k;
            let found = f64::from(after.modulation_dn[i] / before.modulation_dn[i]);
            assert!(
                (found - exact).abs() < 0.01,
                "{px}, period {period_px}: {found} {exact}"
            );
        }
        assert!(compared > 200, "{compared}");
    }
}

#[test]
fn blur_of_a_scene_in_depth_matches_the_reference() {
    let profile = blurred(960.0);
    let object = |shape: &str, place: &str| {
        format!("[[object]]\nshape = {{ {shape} }}\n{place}\nalbedo = 0.7\n")
    };
    let text = [
        "name = \"s\"\ndescription = \"\"\nambient = { irradiance_w_m2 = 0.05 }\n".to_string(),
        object(
            "kind = \"plane\"",
            "position_mm = [0, 0, 1100]\nrotation_deg = [4, -7, 2]",
        ),
        object(
            "kind = \"cylinder\", radius_mm = 60.0, length_mm = 220.0",
            "position_mm = [-60, 10, 960]\nrotation_deg = [10, 0, 35]",
        ),
        object(
            "kind = \"frustum\", base_mm = 160.0, top_mm = 60.0, height_mm = 90.0",
            "position_mm = [120, 20, 930]\nrotation_deg = [0, 0, 30]",
        ),
    ];
    let scene = Scene::parse(&text.concat(), "s").unwrap();
    let reference = Reference::new(&profile, &scene).unwrap();
    let fringe = Pattern::Fringe {
        axis: Axis::X,
        period_px: 64.0,
        phase_rad: 0.4,
    };
    let pattern_image =
        PatternImage::new(&fringe, &profile.projector, &|_| unreachable!()).unwrap();
    let mut renderer = renderer(&profile, &scene, 64);
    let fast = renderer.expected_dn(&shot(pattern_image.clone(), 1.0));
    let flags = renderer.truth(&[]).flags;
    let full = fast.iter().fold(0.0f32, |m, &v| m.max(v));
    assert!((20.0..255.0).contains(&full), "{full}");
    for crease in [false, true] {
        let wanted = Truth::LIT | if crease { Truth::CREASE } else { 0 };
        let pixels: Vec<usize> = (0..flags.len())
            .filter(|&i| flags[i] & (Truth::LIT | Truth::CREASE) == wanted)
            .collect();
        assert!(pixels.len() > 1000, "{}", pixels.len());
        let errors: Vec<f64> = pixels
            .par_iter()
            .step_by(pixels.len() / 150)
            .map(|&i| {
                let px = DVec2::new((i % 1138) as f64, (i / 1138) as f64);
                let exact = reference.signal_dn(px, &pattern_image, 8e-3, 10_000);
                (f64::from(fast[i]) - exact) / f64::from(full)
            })
            .collect();
        let count = errors.len() as f64;
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / count).sqrt();
        let mean = errors.iter().sum::<f64>() / count;
        let (most, bias) = if crease {
            (0.02, 0.004)
        } else {
            (0.004, 0.001)
        };
        assert!(
            rms < most && mean.abs() < bias,
            "crease {crease}: rms {rms}, mean {mean} of the whole"
        );
    }
}
