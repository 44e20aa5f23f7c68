//! Uniformly moving planes compared with closed forms.

use crate::motion::{MS, bench, fringe, instants, scene, shot};
use glam::{DVec2, DVec3};
use phasmid::emulator::render::Term;
use phasmid::emulator::{Shot, Shutter, Truth};
use phasmid::profile::{Profile, Scene};
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// Returns the projector column that lights a point of the scene, from similar triangles.
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

/// Returns a scene with a plane rotated about y that translates uniformly along the scene's axes
/// for ten seconds.
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
fn moving_plane_lies_where_its_speed_puts_it() {
    let profile = bench();
    let (pattern, pattern_image) = fringe(&profile, 16.0, 0.0);
    for (tilt, from, to) in [
        (0.0, [0.0, 0.0, 900.0], [0.0, 0.0, 1300.0]),
        (25.0, [-300.0, 0.0, 1000.0], [500.0, 0.0, 1000.0]),
    ] {
        let mut renderer = instants(&profile, &sliding(tilt, from, to), 4);
        assert!(renderer.plan().has(Term::Motion));
        for start_ms in [0, 40, 2500, 9000] {
            // For two frames, the truth is evaluated at the middle of the interval from the first to
            // the last.
            let shots: Vec<_> = [start_ms, start_ms + 100]
                .map(|ms| (pattern.clone(), shot(&pattern_image, ms * MS, 8 * MS)))
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
                // Far outside the pattern image, f32 has fewer significant digits, so the tolerance
                // is larger.
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
    // With fewer levels, rounding would distort the fringes by more than the effect under test.
    profile.projector.bits = 12;
    let (period, exposure) = (16.0, 8 * MS);
    // The plane moves away from the camera, by half a period of the pattern image during the
    // exposure.
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
                let (_, pattern_image) = fringe(&profile, period, TAU * f64::from(k) / 3.0);
                renderer.expected_dn(&shot(&pattern_image, 0, exposure))
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
        // The point is inside the projector's field during the whole exposure.
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
            // For this number of cycles of a cosine, the midpoint rule gives Dirichlet's kernel,
            // which is too large by a fraction of about (pi cycles / samples)^2 / 6.
            let step = PI * cycles / f64::from(samples);
            let rule = sinc * (step / step.sin() - 1.0);
            let error = blurred[i] / sharp[i] - sinc;
            worst = worst.max((error - rule).abs());
            sums = [sums[0] + error, sums[1] + error - rule];
            compared += 1;
        }
        assert!(compared > 1000, "{compared}");
        // The closed form ignores the edges of held projector pixels, whose effect depends on the
        // pixel's position.
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
    // The plane moves towards the camera at 3 m/s: by 44 mm between the starts of the first and the
    // last row.
    let speed = -3000.0;
    let scene = sliding(0.0, [0.0, 0.0, z], [0.0, 0.0, z + speed * 10.0]);
    let still = sliding(0.0, [0.0, 0.0, z], [0.0, 0.0, z]);
    let exposure_ns = 100_000;
    let signals = |scene: &Scene| -> Vec<Vec<f32>> {
        let mut renderer = instants(&profile, scene, 2);
        (0..3)
            .map(|k| {
                let (_, pattern_image) = fringe(&profile, period, TAU * f64::from(k) / 3.0);
                let shutter = Shutter {
                    line_time_ns: 30_000,
                    first_row: 0,
                    rows: profile.camera.height_px,
                };
                renderer.expected_dn(&Shot {
                    light: 1.0,
                    gain_db: 12.0,
                    shutter,
                    ..shot(&pattern_image, 0, exposure_ns)
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
        // Compared with the image of a still plane, so that the phase error due to held pixels
        // cancels.
        let turn = |x: f64| (x / period - (x / period).round()) * period;
        let error = turn(x - x0 - (at(t) - at(0.0)));
        worst = worst.max(error.abs());
        moved = moved.max((at(t) - at(0.0)).abs());
        compared += 1;
    }
    assert!(compared > 5000 && moved > 30.0, "{compared} {moved}");
    assert!(worst < 0.06, "{worst} px of up to {moved}");
}
