//! Scenes that move: against closed forms, and against the same scene standing still where it is.

use glam::{DVec2, DVec3};
use phasma::emulator::render::{Options, Renderer, Term};
use phasma::emulator::{Shot, Shutter, Slide, Truth};
use phasma::geometry::{Mesh, ply, shapes};
use phasma::pattern::{Axis, Pattern};
use phasma::profile::{Profile, Scene};
use std::f64::consts::{PI, TAU};
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;

const MS: u64 = 1_000_000;

/// A scene of a few lines; its files are in `folder`.
fn scene(lines: &str, folder: &Path) -> Scene {
    let text = format!("name = \"s\"\ndescription = \"\"\n{lines}");
    let mut scene = Scene::parse(&text, "s").unwrap();
    scene.folder = folder.to_path_buf();
    scene
}

fn bench() -> Profile {
    let mut profile = Profile::load("pmp-bench").unwrap();
    profile.camera.sensor.noiseless = true;
    profile
}

fn fringe(profile: &Profile, period_px: f64, phase_rad: f64) -> (Pattern, Arc<Slide>) {
    let pattern = Pattern::Fringe {
        axis: Axis::X,
        period_px,
        phase_rad,
    };
    let slide = Slide::new(&pattern, &profile.projector, &|_| unreachable!()).unwrap();
    (pattern, Arc::new(slide))
}

fn shot(slide: &Arc<Slide>, start_ns: u64, exposure_ns: u64) -> Shot {
    Shot {
        slide: Some(slide.clone()),
        light: 1.0,
        start_ns,
        exposure_ns,
        ..Shot::default()
    }
}

fn instants(profile: &Profile, scene: &Scene, time_samples: u32) -> Renderer {
    renderer(profile, scene, time_samples, 1)
}

fn renderer(profile: &Profile, scene: &Scene, time_samples: u32, seed: u64) -> Renderer {
    let options = Options {
        time_samples,
        ..Options::default()
    };
    Renderer::with_options(profile, scene, seed, options).unwrap()
}

/// Projector column that lights a point of the scene, by similar triangles.
fn column(profile: &Profile, point: DVec3) -> f64 {
    let p = &profile.projector;
    assert_eq!(p.rotation_deg, [0.0; 3]);
    let middle = (f64::from(p.width_px) - 1.0) / 2.0 + p.lens_shift_px[0];
    let focal = p.throw_ratio * f64::from(p.width_px);
    focal * (point.x - p.position_mm[0]) / (point.z - p.position_mm[2]) + middle
}

fn ray(profile: &Profile, pixel: usize) -> DVec3 {
    let c = &profile.camera;
    let (w, h) = (f64::from(c.width_px), f64::from(c.height_px));
    let width = c.width_px as usize;
    let px = DVec2::new((pixel % width) as f64, (pixel / width) as f64);
    let focal = c.focal_length_mm * w / c.sensor_width_mm;
    ((px - (DVec2::new(w, h) - 1.0) / 2.0) / focal).extend(1.0)
}

/// A plane that stands turned about y and moves evenly along the scene's axes for ten seconds.
fn sliding(tilt_deg: f64, from: [f64; 3], to: [f64; 3]) -> Scene {
    let turn = format!("rotation_deg = [0, {tilt_deg:?}, 0]");
    scene(
        &format!(
            "[[object]]\nshape = {{ kind = \"plane\" }}\nalbedo = 0.5\n\
             motion = {{ keyframes = [\n{{ time_s = 0.0, position_mm = {from:?}, {turn} }},\n\
             {{ time_s = 10.0, position_mm = {to:?}, {turn} }} ] }}\n"
        ),
        Path::new(""),
    )
}

#[test]
fn a_plane_that_moves_lies_where_its_speed_has_taken_it() {
    let profile = bench();
    let (pattern, slide) = fringe(&profile, 16.0, 0.0);
    for (tilt, from, to) in [
        (0.0, [0.0, 0.0, 900.0], [0.0, 0.0, 1300.0]),
        (25.0, [-300.0, 0.0, 1000.0], [500.0, 0.0, 1000.0]),
    ] {
        let mut renderer = instants(&profile, &sliding(tilt, from, to), 4);
        assert!(renderer.plan().has(Term::Motion));
        for start_ms in [0, 40, 2500, 9000] {
            // Two frames: the truth is that of the middle between them.
            let shots: Vec<_> = [start_ms, start_ms + 100]
                .map(|ms| (pattern.clone(), shot(&slide, ms * MS, 8 * MS)))
                .into();
            let truth = renderer.truth(&shots);
            let t = (start_ms as f64 + 54.0) * 1e-3;
            let at = DVec3::from(from) + (DVec3::from(to) - DVec3::from(from)) * t / 10.0;
            let (sin, cos) = f64::to_radians(tilt).sin_cos();
            let normal = DVec3::new(sin, 0.0, cos);
            let mut worst = 0.0f64;
            for i in (0..truth.flags.len()).step_by(7) {
                assert_eq!(truth.flags[i] & Truth::MOVING, Truth::MOVING);
                let ray = ray(&profile, i);
                let point = ray * (normal.dot(at) / normal.dot(ray));
                let exact = column(&profile, point);
                // What f32 holds far outside of the slide is less.
                let bar = 1e-3 + (exact.abs() - 8192.0).max(0.0) * 6e-8;
                worst = worst.max((f64::from(truth.projector_x[i]) - exact).abs() / bar);
                let depth = (f64::from(truth.depth_mm[i]) - point.z).abs();
                assert!(depth < 1e-7 * point.z, "{depth}");
            }
            assert!(worst < 1.0, "{worst} of 1e-3 px");
        }
    }
}

#[test]
fn a_fringe_that_moves_keeps_the_contrast_of_its_integral() {
    let mut profile = bench();
    // Coarser levels bend a fringe by more than what is looked for.
    profile.projector.bits = 12;
    let (period, exposure) = (16.0, 8 * MS);
    // Away from the camera, half a period of the slide's while it exposes.
    let speed = 900.0;
    let z = 1000.0;
    let still = sliding(0.0, [0.0, 0.0, z], [0.0, 0.0, z]);
    let moving = sliding(
        0.0,
        [0.0, 0.0, z - speed * 4e-3],
        [0.0, 0.0, z + speed * 9.996],
    );
    let contrast = |scene: &Scene, samples: u32| {
        let mut renderer = instants(&profile, scene, samples);
        let signals: Vec<_> = (0..3)
            .map(|k| {
                let (_, slide) = fringe(&profile, period, TAU * f64::from(k) / 3.0);
                renderer.expected_dn(&shot(&slide, 0, exposure))
            })
            .collect();
        let truth = renderer.truth(&[]);
        let lit = Truth::LIT | Truth::CREASE | Truth::SQUARE;
        let pixel = |i: usize| {
            let (mut re, mut im) = (0.0, 0.0);
            for (k, signal) in signals.iter().enumerate() {
                let (sin, cos) = (TAU * k as f64 / 3.0).sin_cos();
                re += f64::from(signal[i]) * cos;
                im += f64::from(signal[i]) * sin;
            }
            re.hypot(im) / 1.5
        };
        // In the projector's field throughout.
        let within = |x: f32, side: u32| (40.0..side as f32 - 40.0).contains(&x);
        let inner = |i: usize| {
            truth.flags[i] & lit == Truth::LIT | Truth::SQUARE
                && within(truth.projector_x[i], profile.projector.width_px)
                && within(truth.projector_y[i], profile.projector.height_px)
        };
        (0..truth.flags.len())
            .map(|i| if inner(i) { pixel(i) } else { 0.0 })
            .collect::<Vec<f64>>()
    };
    let sharp = contrast(&still, 4);
    let mut former = f64::INFINITY;
    for samples in [1, 2, 4, 8] {
        let blurred = contrast(&moving, samples);
        let (mut compared, mut worst, mut sums) = (0, 0.0f64, [0.0; 2]);
        for i in (0..sharp.len()).step_by(11) {
            if sharp[i] < 30.0 || blurred[i] == 0.0 {
                continue;
            }
            let at = |t: f64| column(&profile, ray(&profile, i) * (z + speed * t));
            let cycles = (at(4e-3) - at(-4e-3)) / period;
            let sinc = (PI * cycles).sin() / (PI * cycles);
            // What the midpoint rule makes of a cosine over that many cycles, Dirichlet's kernel,
            // is too much by some (pi cycles / samples)^2 / 6 of it.
            let step = PI * cycles / f64::from(samples);
            let rule = sinc * (step / step.sin() - 1.0);
            let error = blurred[i] / sharp[i] - sinc;
            worst = worst.max((error - rule).abs());
            sums = [sums[0] + error, sums[1] + error - rule];
            compared += 1;
        }
        assert!(compared > 1000, "{compared}");
        // Edges of held pixels, which the closed form has not, come and go with a pixel's place.
        assert!(worst < 8e-3, "{samples} instants: {worst}");
        let [error, beyond] = sums.map(|sum| (sum / f64::from(compared)).abs());
        assert!(beyond < 1e-3, "{samples} instants: {beyond}");
        assert!(
            error < former / 3.5 || error < 1e-3,
            "{samples}: {error} after {former}"
        );
        former = error;
    }
}

#[test]
fn rows_of_a_rolling_shutter_see_a_plane_at_their_own_time() {
    let mut profile = bench();
    profile.camera.line_time_us = 30.0;
    profile.projector.bits = 12;
    let (period, z) = (64.0, 1000.0);
    // Toward the camera at 3 m/s: by 44 mm while the rows start.
    let speed = -3000.0;
    let scene = sliding(0.0, [0.0, 0.0, z], [0.0, 0.0, z + speed * 10.0]);
    let still = sliding(0.0, [0.0, 0.0, z], [0.0, 0.0, z]);
    let exposure_ns = 100_000;
    let signals = |scene: &Scene| -> Vec<Vec<f32>> {
        let mut renderer = instants(&profile, scene, 2);
        (0..3)
            .map(|k| {
                let (_, slide) = fringe(&profile, period, TAU * f64::from(k) / 3.0);
                let shutter = Shutter {
                    line_time_ns: 30_000,
                    first_row: 0,
                    rows: profile.camera.height_px,
                };
                renderer.expected_dn(&Shot {
                    light: 1.0,
                    gain_db: 12.0,
                    shutter,
                    ..shot(&slide, 0, exposure_ns)
                })
            })
            .collect()
    };
    let wrapped = |signals: &[Vec<f32>], i: usize| {
        let (mut re, mut im) = (0.0, 0.0);
        for (k, signal) in signals.iter().enumerate() {
            let (sin, cos) = (TAU * k as f64 / 3.0).sin_cos();
            re += f64::from(signal[i]) * cos;
            im -= f64::from(signal[i]) * sin;
        }
        (im.atan2(re) / TAU * period, re.hypot(im))
    };
    let (moving, still) = (signals(&scene), signals(&still));
    let width = profile.camera.width_px as usize;
    let (mut compared, mut worst, mut moved) = (0, 0.0f64, 0.0f64);
    for i in (0..moving[0].len()).step_by(3) {
        let row = i / width;
        let at = |t: f64| column(&profile, ray(&profile, i) * (z + speed * t));
        let t = row as f64 * 30e-6 + 50e-6;
        let ((x, strength), (x0, strength0)) = (wrapped(&moving, i), wrapped(&still, i));
        if strength < 2.0 || strength0 < 2.0 || !(60.0..1860.0).contains(&at(t)) {
            continue;
        }
        // Against the still plane, so that what held pixels do to a phase cancels.
        let turn = |x: f64| (x / period - (x / period).round()) * period;
        let error = turn(x - x0 - (at(t) - at(0.0)));
        worst = worst.max(error.abs());
        moved = moved.max((at(t) - at(0.0)).abs());
        compared += 1;
    }
    assert!(compared > 5000 && moved > 30.0, "{compared} {moved}");
    assert!(worst < 0.06, "{worst} px of up to {moved}");
}

/// A sheet that bulges towards the camera, with colours.
fn write_sheet(path: &Path, bulge: f64) {
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

/// Lamps, a floor and something that stands in front of it.
fn room(object: &str, folder: &Path) -> Scene {
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

/// A checker of squares.
fn write_checker(path: &Path) {
    let level = |x: u32, y: u32| image::Luma([if (x + y).is_multiple_of(2) { 230u8 } else { 90 }]);
    image::GrayImage::from_fn(8, 8, level).save(path).unwrap();
}

/// Bytes that differ between two frames.
fn apart(a: &[u8], b: &[u8]) -> usize {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).filter(|(a, b)| a != b).count()
}

/// Frame and truth of an instant in which `moving` looks as `still` does, and is moving.
fn same(profile: &Profile, still: &Scene, moving: &Scene, time_ns: u64, what: &str) {
    let (_, slide) = fringe(profile, 16.0, 0.4);
    let exposure = shot(&slide, time_ns - 4 * MS, 8 * MS);
    let mut rest = instants(profile, still, 1);
    let mut moved = instants(profile, moving, 1);
    assert!(moved.plan().has(Term::Motion) && !rest.plan().has(Term::Motion));
    let (a, b) = (rest.expose(&exposure).data, moved.expose(&exposure).data);
    // f64 has the same triangle in two frames, to its last digits; f32 rounds some of them apart.
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
fn what_moves_looks_like_what_stands_there() {
    let dir = tempfile::tempdir().unwrap();
    write_sheet(&dir.path().join("sheet.obj"), 30.0);
    write_checker(&dir.path().join("checker.png"));
    let looks = "albedo = 0.8\nspecular = { f0 = 0.04, roughness = 0.4 }\n\
                 texture = \"checker.png\"\ntexture_size_mm = [160.0, 160.0]\n";
    let profile = bench();
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
        // Half way of an even turn and shift about its own origin.
        let still = object("position_mm = [30, -20, 1000]\nrotation_deg = [0, 0, 30]");
        let moving = object(
            "position_mm = [0, 0, 1000]\nmotion = { keyframes = [\n\
             { time_s = 1.0, position_mm = [10, 20, 40], rotation_deg = [0, 0, 10] },\n\
             { time_s = 3.0, position_mm = [50, -60, -40], rotation_deg = [0, 0, 50] } ] }",
        );
        same(&profile, &still, &moving, 2_000_000_000, shape);
        // A pose of its own, then where it rests, one after the other.
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
    profile.camera.line_time_us = 30.0;
    let line_time_ns = 30_000;
    let (_, slide) = fringe(&profile, 16.0, 0.4);
    let rolling = Shot {
        shutter: Shutter {
            line_time_ns,
            first_row: 0,
            rows: profile.camera.height_px,
        },
        ..shot(&slide, 20 * MS, 8 * MS)
    };
    let width = profile.camera.width_px as usize;
    // What deforms has sixteen shapes in the 15 ms of a frame: half a millisecond off at most, or
    // 0.15 mm at the top of the bulge.
    for (more, samples, bar) in [(way, 1, 2e-3), (way, 16, 2e-3), (breath, 1, 6.0)] {
        let options = Options {
            samples,
            time_samples: 2,
        };
        let scene = object(more);
        let mut renderer = Renderer::with_options(&profile, &scene, 1, options).unwrap();
        let rolled = renderer.expected_dn(&rolling);
        let mut global = Renderer::with_options(&profile, &scene, 1, options).unwrap();
        global.force(Term::RollingShutter, false);
        let early = global.expected_dn(&rolling);
        for row in [0, 170, 243, 330] {
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
            // On edges, neighbouring rows decide what is sampled.
            assert!(off(&all) <= 6, "{more} {samples} {row}: {}", off(&all));
            if row == 243 && bar < 1.0 {
                assert!(off(&early) > 100, "{row}: it has moved: {}", off(&early));
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
    // It may move as well; what is laid over it moves along with its triangles.
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
    let (_, slide) = fringe(&profile, 16.0, 0.4);
    let exposure = shot(&slide, 2_996 * MS, 8 * MS);
    let a = instants(&profile, &still, 1).expose(&exposure).data;
    let b = instants(&profile, &both, 1).expose(&exposure).data;
    // The sheet bulges along z alone, and so the picture thrown along z stays where it was.
    let off = apart(&a, &b);
    assert!(off < 20, "{off} bytes");
}

#[test]
fn what_has_a_way_but_stands_still_keeps_every_byte() {
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
    let (_, slide) = fringe(&profile, 16.0, 0.4);
    let exposure = shot(&slide, 500 * MS, 8 * MS);
    let still = Renderer::new(&profile, &object(place), 3)
        .unwrap()
        .expose(&exposure);
    // Held after its last keyframe, every instant of the exposure is the same: it costs one.
    let held = object(
        "motion = { keyframes = [ { time_s = 0.1 }, \
         { time_s = 0.4, position_mm = [10, 0, 1080] } ] }",
    );
    let mut held = renderer(&profile, &held, 4, 3);
    let off = apart(&still.data, &held.expose(&exposure).data);
    assert!(off <= 3, "{off}");
    assert!(!held.prepare(), "its geometry is at hand");
    // And a scene in which nothing moves has one instant, though it is asked for more.
    let mut forced = renderer(&profile, &object(place), 7, 3);
    forced.force(Term::Motion, true);
    assert_eq!(still.data, forced.expose(&exposure).data);
}

#[test]
fn exposures_from_a_microsecond_to_ten_seconds() {
    let mut profile = bench();
    profile.projector.radiant_intensity_w_sr = 0.8;
    let (_, slide) = fringe(&profile, 16.0, 0.4);
    // Up and down by 20 mm within a second.
    let object = "shape = { kind = \"sphere\", radius_mm = 60.0 }\nalbedo = 0.5\n\
                  position_mm = [0, 0, 980]\nmotion = { period_s = 1.0, keyframes = [\n\
                  { time_s = 0.0 }, { time_s = 0.5, position_mm = [0, 0, -20] } ] }\n";
    let moving = room(object, Path::new(""));
    let white = Arc::new(Slide::Uniform(255));
    for exposure_ns in [1000, 50_000, 8 * MS, 200 * MS, 10_000 * MS] {
        let mut renderer = instants(&profile, &moving, 5);
        // Full light all the time would fill the wells.
        let light = 4e6 / exposure_ns as f64;
        let exposure = Shot {
            light: light.min(1.0),
            ..shot(&white, 77, exposure_ns)
        };
        let found = renderer.expected_dn(&exposure);
        assert!(found.iter().all(|v| v.is_finite()));
        // The mean over as many renderers that stand still, each a fifth of the time.
        let middle = (77.0 + exposure_ns as f64 / 2.0) * 1e-9;
        let bright = found.iter().filter(|v| **v > 8.0).count();
        if exposure_ns >= 8 * MS {
            assert!(
                bright > 5000,
                "{exposure_ns} ns at {middle} s: {bright} pixels"
            );
        }
        let frame = renderer.expose(&Shot {
            slide: Some(slide.clone()),
            ..exposure
        });
        assert_eq!(frame.exposure_end_ns - frame.exposure_start_ns, exposure_ns);
    }
    // The last moment of device time is a moment like any other.
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
    // Behind the camera, where nobody sees it.
    let behind = "[[object]]\nshape = { kind = \"sphere\", radius_mm = 5.0 }\nalbedo = 0.5\n\
                  motion = { keyframes = [ { time_s = 0.0, position_mm = [0, 0, -900] }, \
                  { time_s = 1.0, position_mm = [0, 0, -950] } ] }\n";
    let (_, slide) = fringe(&profile, 16.0, 0.4);
    for glare in [
        None,
        Some(phasma::profile::Glare {
            percent: 3.0,
            sigma_px: 40.0,
        }),
    ] {
        profile.camera.glare = glare;
        let still = scene(lit, Path::new(""));
        let moving = scene(&format!("{lit}{behind}"), Path::new(""));
        for exposure_ns in [1_234_567, 8 * MS] {
            let exposure = shot(&slide, 3 * MS, exposure_ns);
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
                "as the object's own",
            ],
        ),
        (
            "turned.ply",
            vec!["turned.ply: triangle 7", "as in the object's own mesh"],
        ),
        (
            "absent.ply",
            vec!["keyframes[1].file", "absent.ply", "a file that is there"],
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
    for time_samples in [0, 257] {
        let options = Options {
            time_samples,
            ..Options::default()
        };
        let scene = Scene::load("plane").unwrap();
        let refused = Renderer::with_options(&bench(), &scene, 1, options);
        let message = refused.err().unwrap().to_string();
        assert!(
            message.contains("time samples") && message.contains("1 to 256"),
            "{message}"
        );
    }
}
