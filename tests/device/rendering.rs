//! Compares the passes of the production renderer with the slow reference renderer in f64, which
//! shares no approximation with them.

use glam::DVec2;
use phasmid::emulator::render::reference::Reference;
use phasmid::emulator::render::{Renderer, Term};
use phasmid::emulator::{PatternImage, Shot, Truth};
use phasmid::pattern::{Axis, Pattern};
use phasmid::profile::{Profile, Scene};
use rayon::prelude::*;
use std::sync::Arc;

fn bench(distorted: bool) -> Profile {
    let mut profile = Profile::load("pmp-bench").unwrap();
    if distorted {
        profile.camera.distortion = [-0.12, 0.05, 8e-4, -5e-4, -0.004];
        profile.projector.distortion = [-0.05, 0.02, -4e-4, 6e-4, 0.001];
    }
    profile
}

fn scenes() -> Vec<Scene> {
    let mut scenes: Vec<_> = ["plane", "sphere", "trapezoid"]
        .map(|name| Scene::load(name).unwrap())
        .into();
    let object = |shape: &str, place: &str| {
        format!("[[object]]\nshape = {{ {shape} }}\n{place}\nalbedo = 0.7\n")
    };
    // Tilted solids that shade each other; one of them extends beyond the floor behind it.
    let solids = [
        "name = \"solids\"\ndescription = \"\"\nambient = { irradiance_w_m2 = 0.05 }\n".to_string(),
        object(
            "kind = \"plane\", size_mm = [520.0, 300.0]",
            "position_mm = [20, 5, 1040]\nrotation_deg = [4, -7, 2]",
        ),
        object(
            "kind = \"cylinder\", radius_mm = 40.0, length_mm = 120.0",
            "position_mm = [-60, 10, 960]\nrotation_deg = [10, 0, 35]",
        ),
        object(
            "kind = \"sphere\", radius_mm = 30.0",
            "position_mm = [70, -20, 900]",
        ),
        object(
            "kind = \"frustum\", base_mm = 60.0, top_mm = 20.0, height_mm = 40.0",
            "position_mm = [140, 60, 1020]\nrotation_deg = [0, 0, 30]\nscale = 1.5",
        ),
    ];
    scenes.push(Scene::parse(&solids.concat(), "solids").unwrap());
    // A mesh small enough for the reference renderer, which tests every triangle.
    let mesh = [
        "name = \"mesh\"\ndescription = \"\"\n".to_string(),
        object("kind = \"plane\"", "position_mm = [0, 0, 1150]"),
        object(
            "kind = \"torso\", triangles = 1500, seed = 3",
            "position_mm = [0, 0, 1150]\nrotation_deg = [0, 0, 80]\nscale = 0.8",
        ),
    ];
    scenes.push(Scene::parse(&mesh.concat(), "mesh").unwrap());
    scenes
}

fn pattern_image(pattern: &Pattern, profile: &Profile) -> Arc<PatternImage> {
    Arc::new(PatternImage::new(pattern, &profile.projector, &|_| unreachable!()).unwrap())
}

fn shot(pattern_image: &Arc<PatternImage>) -> Shot {
    Shot {
        id: 1,
        noise_id: 1,
        pattern_image: Some(pattern_image.clone()),
        light: 1.0,
        exposure_ns: 8_000_000,
        ..Shot::default()
    }
}

#[test]
fn projector_coordinates_light_and_sight_agree() {
    for distorted in [false, true] {
        let profile = bench(distorted);
        for scene in scenes() {
            let reference = Reference::new(&profile, &scene).unwrap();
            let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
            let truth = renderer.truth(&[]);
            let (mut compared, mut off, mut lit_off) = (0, 0, 0);
            let mut worst = 0.0f64;
            let step = if renderer.triangle_count() > 0 { 61 } else { 3 };
            for i in (0..truth.flags.len()).step_by(step) {
                if truth.flags[i] & Truth::CREASE != 0 {
                    continue;
                }
                let (u, v) = (i % truth.width as usize, i / truth.width as usize);
                let found = reference.trace(DVec2::new(u as f64, v as f64));
                let seen = truth.flags[i] & Truth::SEEN != 0;
                assert_eq!(seen, found.is_some(), "{} ({u}, {v})", scene.name);
                let Some(found) = found else { continue };
                compared += 1;
                lit_off += usize::from(found.lit != (truth.flags[i] & Truth::LIT != 0));
                if !found.projector_px.is_finite() {
                    continue;
                }
                let px = DVec2::new(truth.projector_x[i].into(), truth.projector_y[i].into());
                // Far outside the pattern image, f32 coordinates have fewer significant digits.
                let bar = 1e-3 + found.projector_px.length().max(8192.0) * 6e-8 - 8192.0 * 6e-8;
                let error = (px - found.projector_px).abs().max_element();
                worst = worst.max(error.min(bar));
                off += usize::from(error > bar);
            }
            assert!(compared > 5000, "{}: {compared}", scene.name);
            assert_eq!(
                (off, lit_off),
                (0, 0),
                "{}: of {compared}, worst {worst:.1e}",
                scene.name
            );
        }
    }
}

#[test]
fn grey_levels_agree_away_from_edges_and_are_bounded_on_them() {
    let patterns = |profile: &Profile| {
        let fringe = |axis, period_px| {
            pattern_image(
                &Pattern::Fringe {
                    axis,
                    period_px,
                    phase_rad: 0.7,
                },
                profile,
            )
        };
        let gray = |axis, bit| {
            pattern_image(
                &Pattern::Gray {
                    axis,
                    cell_px: 8.0,
                    bits: 8,
                    bit,
                    inverted: false,
                },
                profile,
            )
        };
        let image = PatternImage::Image {
            width: 1920,
            height: 1080,
            levels: (0..1920 * 1080u32)
                .map(|i| ((i % 1920 / 40 + i / 1920 / 40) % 5 * 60) as u16)
                .collect(),
        };
        [
            pattern_image(&Pattern::White {}, profile),
            fringe(Axis::X, 16.0),
            fringe(Axis::X, 7.3),
            fringe(Axis::Y, 20.0),
            gray(Axis::X, 0),
            gray(Axis::X, 6),
            gray(Axis::Y, 1),
            Arc::new(image),
        ]
    };
    for distorted in [false, true] {
        let profile = bench(distorted);
        for scene in scenes() {
            let reference = Reference::new(&profile, &scene).unwrap();
            let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
            let mesh = renderer.triangle_count() > 0;
            let flags = renderer.truth(&[]).flags;
            let flags_at = |i: usize| flags.get(i).copied().unwrap_or(0);
            for (k, pattern_image) in patterns(&profile).iter().enumerate() {
                let fast = renderer.expected_dn(&shot(pattern_image));
                // Edges: mixed pixels, and the silhouette of spheres, where a pixel's footprint is
                // curved.
                let wanted = |edge: bool| {
                    let count = if mesh { 8 } else { 40 };
                    let smooth = Truth::LIT | Truth::SQUARE;
                    let of_kind: Vec<_> = (0..flags.len())
                        .filter(|&i| {
                            let flags = flags[i];
                            let lit = flags & Truth::LIT != 0;
                            // Sixteen samples may miss an edge that cuts off only a corner of a
                            // pixel.
                            let near =
                                [i.wrapping_sub(1138), i.wrapping_sub(1), i, i + 1, i + 1138];
                            let even = near
                                .iter()
                                .all(|&j| flags_at(j) & (smooth | Truth::CREASE) == smooth);
                            if edge {
                                flags & Truth::CREASE != 0 || (lit && !even)
                            } else {
                                even
                            }
                        })
                        .collect();
                    let step = (of_kind.len() / count).max(1);
                    of_kind.into_iter().step_by(step).skip(k % 3)
                };
                let error = |i: usize, rays| {
                    let (u, v) = (i % 1138, i / 1138);
                    let px = DVec2::new(u as f64, v as f64);
                    (f64::from(fast[i]) - reference.signal_dn(px, pattern_image, 8e-3, rays)).abs()
                };
                let rays = if mesh { 512 } else { 2048 };
                // Two-dimensional patterns are averaged over a rectangle instead of the
                // parallelogram.
                let image = matches!(**pattern_image, PatternImage::Image { .. });
                let bar = match (image, scene.name.as_str()) {
                    (true, _) => 6.0,
                    // Spheres of 20 pixels have curved footprints; on the mesh the reference uses
                    // only 512 rays.
                    (_, "solids") => 2.5,
                    (_, "mesh") => 1.0,
                    _ => 0.5,
                };
                let errors = |edge: bool| -> Vec<f64> {
                    let pixels: Vec<_> = wanted(edge).collect();
                    pixels.into_par_iter().map(|i| error(i, rays)).collect()
                };
                let smooth = errors(false);
                let worst = smooth.iter().copied().fold(0.0, f64::max);
                assert!(smooth.len() >= 5);
                let exact = smooth.iter().filter(|&&e| e < 0.5).count();
                assert!(
                    image || exact * 10 >= smooth.len() * 8,
                    "{} slide {k}",
                    scene.name
                );
                assert!(
                    worst < bar,
                    "{} slide {k} distorted {distorted}: {worst} DN",
                    scene.name
                );
                // Sixteen samples resolve an edge to a few per cent of the step between its two
                // sides.
                let edges = errors(true);
                let mean = edges.iter().sum::<f64>() / edges.len().max(1) as f64;
                let far = edges.iter().filter(|&&e| e > 25.0).count();
                assert!(
                    mean < 6.0 && far * 20 <= edges.len(),
                    "{} slide {k}: mean {mean} far {far} of {}",
                    scene.name,
                    edges.len()
                );
            }
        }
    }
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let profile = bench(false);
    let scene = Scene::load("torso").unwrap();
    let render = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let mut renderer = Renderer::new(&profile, &scene, 42).unwrap();
            profile.sequence[0].frame[..3]
                .iter()
                .map(|f| {
                    renderer
                        .expose(&shot(&pattern_image(&f.pattern, &profile)))
                        .data
                })
                .collect::<Vec<_>>()
        })
    };
    let one = render(1);
    assert_eq!(one, render(2));
    assert_eq!(one, render(3));
}

#[test]
fn terms_left_out_by_the_plan_change_no_byte() {
    let profile = bench(false);
    for name in ["plane", "sphere"] {
        let scene = Scene::load(name).unwrap();
        let fringe = pattern_image(&profile.sequence[0].frame[0].pattern, &profile);
        let along_y = pattern_image(
            &Pattern::Fringe {
                axis: Axis::Y,
                period_px: 9.0,
                phase_rad: 0.0,
            },
            &profile,
        );
        let mut lean = Renderer::new(&profile, &scene, 7).unwrap();
        let lean_bytes = lean.expose(&shot(&fringe)).data;
        assert!(!lean.plan().has(Term::FootprintY));
        let mut full = Renderer::new(&profile, &scene, 7).unwrap();
        for term in Term::ALL {
            full.force(term, true);
        }
        full.expect_pattern_images([along_y.as_ref()]);
        assert!(full.plan().has(Term::FootprintY) && full.plan().has(Term::Shadows));
        assert_eq!(lean_bytes, full.expose(&shot(&fringe)).data, "{name}");
    }
}

/// A pixel that sees no surface has the black level, even next to a lit surface in the same block
/// of pixels that are averaged together.
#[test]
fn pixels_without_surface_read_the_black_level() {
    let profile = bench(false);
    let text = "name = \"s\"\ndescription = \"\"\n[[object]]\n\
        shape = { kind = \"plane\", size_mm = [211.0, 173.0] }\nposition_mm = [3, 5, 1000]\nalbedo = 0.8\n";
    let scene = Scene::parse(text, "s").unwrap();
    let mut renderer = Renderer::new(&profile, &scene, 7).unwrap();
    let fringe = pattern_image(&profile.sequence[0].frame[0].pattern, &profile);
    let found = renderer.expected_dn(&shot(&fringe));
    let truth = renderer.truth(&[]);
    let mut empty = 0;
    for (dn, flags) in found.iter().zip(&truth.flags) {
        if flags & (Truth::SEEN | Truth::CREASE) == 0 {
            assert_eq!(*dn, 4.0);
            empty += 1;
        }
    }
    assert!(empty > 100_000 && empty < found.len() - 1000, "{empty}");
}

#[test]
fn noise_is_that_of_the_sensor() {
    // A photon transfer curve: variance against mean over frames of one still scene gives back the
    // gain, and its intercept gives the read noise plus 1/12 for rounding (EMVA 1288, section 6).
    let profile = bench(false);
    let scene = Scene::load("trapezoid").unwrap();
    let mut renderer = Renderer::new(&profile, &scene, 5).unwrap();
    let frames = 40;
    let fringe = pattern_image(&profile.sequence[0].frame[0].pattern, &profile);
    let expected = renderer.expected_dn(&shot(&fringe));
    let mut sums = vec![(0.0f64, 0.0f64); expected.len()];
    for id in 0..frames {
        let frame = renderer.expose(&Shot {
            noise_id: id,
            ..shot(&fringe)
        });
        for (s, &v) in sums.iter_mut().zip(&frame.data) {
            let d = f64::from(v);
            *s = (s.0 + d, s.1 + d * d);
        }
    }
    let n = frames as f64;
    let bins: Vec<(f64, f64)> = (0..10)
        .map(|b| {
            let (low, high) = (8.0 + 18.0 * f64::from(b), 26.0 + 18.0 * f64::from(b));
            let of_bin = sums
                .iter()
                .zip(&expected)
                .filter(|(_, e)| (low..high).contains(&f64::from(**e)));
            let mut total = (0.0, 0.0, 0.0);
            for ((s, q), e) in of_bin {
                total.0 += 1.0;
                total.1 += f64::from(*e);
                total.2 += (q - s * s / n) / (n - 1.0);
            }
            assert!(total.0 > 500.0);
            (total.1 / total.0, total.2 / total.0)
        })
        .collect();
    let (mx, my) = (
        bins.iter().map(|b| b.0).sum::<f64>() / 10.0,
        bins.iter().map(|b| b.1).sum::<f64>() / 10.0,
    );
    let gain = bins.iter().map(|b| (b.0 - mx) * (b.1 - my)).sum::<f64>()
        / bins.iter().map(|b| (b.0 - mx).powi(2)).sum::<f64>();
    let sensor = &profile.camera.sensor;
    assert!(
        (gain / sensor.gain_dn_per_e - 1.0).abs() < 0.01,
        "gain {gain}"
    );
    let dark = my - gain * (mx - sensor.black_level_dn);
    let expected_dark = (sensor.read_noise_e * sensor.gain_dn_per_e).powi(2) + 1.0 / 12.0;
    assert!(
        (dark - expected_dark).abs() < 0.02,
        "{dark} {expected_dark}"
    );
}

#[test]
fn a_solid_around_the_camera_is_shaded_by_its_own_wall() {
    let profile = bench(false);
    // The projector's pupil is 400 mm to the side: outside the first sphere and inside the second.
    for (radius, lit) in [(395.0, false), (405.0, true)] {
        let text = format!(
            "name = \"shell\"\ndescription = \"\"\n[[object]]\n\
             shape = {{ kind = \"sphere\", radius_mm = {radius} }}\nalbedo = 0.1\n"
        );
        let scene = Scene::parse(&text, "shell").unwrap();
        let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
        let flags = renderer.truth(&[]).flags;
        let any = flags.iter().any(|f| f & Truth::LIT != 0);
        assert_eq!(any, lit, "radius {radius}");
    }
}

#[test]
fn a_distorted_projector_lights_nothing_beyond_its_field() {
    // Barrel distortion so strong that its polynomial folds back into the image at wide angles.
    // Light falls on one connected region, and each lit pixel's ray leads back to its point.
    let mut profile = bench(false);
    profile.camera.focal_length_mm = 6.0;
    profile.projector.throw_ratio = 1.0;
    profile.projector.lens_shift_px = [0.0, 0.0];
    profile.projector.distortion = [-0.3, 0.0, 0.0, 0.0, 0.0];
    let scene = Scene::load("plane").unwrap();
    let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
    let truth = renderer.truth(&[]);
    let (camera, projector) = (profile.camera.view(), profile.projector.view());
    let mut lit = 0;
    for i in (0..truth.flags.len()).filter(|&i| truth.flags[i] & Truth::LIT != 0) {
        lit += 1;
        let px = DVec2::new((i % 1138) as f64, (i / 1138) as f64);
        let point = camera.ray(px) * f64::from(truth.depth_mm[i]);
        let pattern_image = DVec2::new(truth.projector_x[i].into(), truth.projector_y[i].into());
        let ray = projector.ray(pattern_image);
        let way = point - projector.center();
        let off = (way - ray * (way.dot(ray) / ray.length_squared())).length();
        assert!(
            off < 1e-3 * way.length(),
            "({px}): the slide's ray misses by {off} mm"
        );
    }
    assert!(lit > 1000, "{lit}");
}
