//! GPU and CPU agree for every pass and every term of image formation, with one case each.
//! [`crate::variations`] has more cases.

use crate::case::Case;
use crate::compare::agree;
use phasmid::emulator::render::{Plan, Term};
use phasmid::pattern::{Axis, Pattern};
use phasmid::profile::{CameraResponse, Profile, Response};
use std::path::Path;

/// Two tilted solids that shade each other, in front of a wall.
pub const SOLIDS: &str = "ambient = { irradiance_w_m2 = 0.05 }
[[object]]
shape = { kind = \"plane\" }
position_mm = [0, 0, 1060]
rotation_deg = [6, -9, 2]
albedo = 0.8
[[object]]
shape = { kind = \"sphere\", radius_mm = 40.0 }
position_mm = [-50, 10, 960]
albedo = 0.7
[[object]]
shape = { kind = \"cylinder\", radius_mm = 30.0, length_mm = 120.0 }
position_mm = [70, 0, 980]
rotation_deg = [10, 20, 35]
albedo = 0.6
[[object]]
shape = { kind = \"frustum\", base_mm = 60.0, top_mm = 20.0, height_mm = 40.0 }
position_mm = [20, 60, 1020]
rotation_deg = [0, 0, 30]
albedo = 0.7
";

/// Returns a scene with a mesh in front of a wall; `more` holds additional fields of the mesh's
/// object.
pub fn torso(more: &str) -> String {
    format!(
        "ambient = {{ irradiance_w_m2 = 0.05 }}
[[object]]
shape = {{ kind = \"plane\" }}
position_mm = [0, 0, 1200]
albedo = 0.8
[[object]]
shape = {{ kind = \"torso\", triangles = 5000, seed = 3 }}
position_mm = [60, 0, 1150]
rotation_deg = [0, 0, 80]
scale = 0.8
albedo = 0.75
{more}
"
    )
}

pub fn fringe(axis: Axis, period_px: f64) -> Pattern {
    Pattern::Fringe {
        axis,
        period_px,
        phase_rad: 0.3,
    }
}

pub fn real(name: &'static str, scene: &str, change: impl FnOnce(&mut Profile)) -> Case {
    Case::with(name, "pmp-real", scene, Path::new("."), change)
}

pub fn solids() -> Case {
    let mut case = Case::new("solids", SOLIDS);
    case.shoot(&[
        fringe(Axis::X, 16.0),
        fringe(Axis::Y, 9.0),
        Pattern::White {},
    ]);
    case.shoot_image();
    case
}

/// Returns a case with distortions, vignetting, both focuses, contrast, glare, dark current and
/// fixed pattern.
fn real_bench() -> Case {
    let mut case = real("real-bench", &torso(""), |_| {});
    case.shoot(&[fringe(Axis::X, 16.0), fringe(Axis::Y, 24.0)]);
    case.shoot_image();
    case
}

/// Returns a case with a 12-bit sensor with blooming and a non-linear response, and a projector with
/// a gamma.
fn bent() -> Case {
    real("bent", SOLIDS, |profile| {
        let sensor = &mut profile.camera.sensor;
        sensor.blooming_percent = 20.0;
        sensor.response = CameraResponse::Gamma { gamma: 1.6 };
        sensor.bits = 12;
        sensor.gain_dn_per_e = 0.38;
        profile.projector.response = Some(Response::Gamma(2.2));
        profile.projector.radiant_intensity_w_sr *= 1.8;
    })
}

fn looks(folder: &Path) -> Case {
    let board = image::GrayImage::from_fn(32, 32, |x, y| {
        image::Luma([40 + 6 * ((x * 7 + y * 13) % 32) as u8])
    });
    board.save(folder.join("board.png")).unwrap();
    let scene = "ambient = { irradiance_w_m2 = 0.05, flicker = { frequency_hz = 100, depth = 0.4, phase_deg = 20.0 } }
[[light]]
kind = \"point\"
position_mm = [-400.0, -300.0, 500.0]
intensity_w_sr = 0.2
flicker = { frequency_hz = 100, depth = 0.3, phase_deg = 20.0 }
[[light]]
kind = \"directional\"
direction = [0.4, 0.3, 1.0]
irradiance_w_m2 = 0.3
[[object]]
shape = { kind = \"plane\" }
position_mm = [0, 0, 1100]
rotation_deg = [5, -12, 2]
albedo = 0.8
texture = \"board.png\"
texture_size_mm = [150.0, 150.0]
[[object]]
shape = { kind = \"torso\", triangles = 4000, seed = 5 }
position_mm = [80, 0, 1150]
rotation_deg = [0, 0, 80]
scale = 0.7
albedo = 0.6
specular = { f0 = 0.04, roughness = 0.35 }
[[object]]
shape = { kind = \"sphere\", radius_mm = 50.0 }
position_mm = [-70, 0, 980]
albedo = 0.4
specular = { f0 = 0.3, roughness = 0.2 }
";
    Case::with("looks", "pmp-bench", scene, folder, |_| {})
}

fn skin() -> Case {
    let mut case = real("skin", &torso("skin = { fitzpatrick = 2 }"), |_| {});
    case.shoot(&[
        fringe(Axis::X, 16.0),
        fringe(Axis::Y, 24.0),
        Pattern::White {},
    ]);
    case.shoot_image();
    case
}

fn interreflection() -> Case {
    let scene = "[interreflection]
samples = 64
step_px = 4
[[light]]
kind = \"point\"
position_mm = [-300.0, -200.0, 600.0]
intensity_w_sr = 0.2
[[object]]
shape = { kind = \"plane\", size_mm = [300.0, 300.0] }
position_mm = [-80, 0, 1050]
rotation_deg = [0, 45, 0]
albedo = 0.9
[[object]]
shape = { kind = \"plane\", size_mm = [300.0, 300.0] }
position_mm = [120, 0, 1050]
rotation_deg = [0, -45, 0]
albedo = 0.9
";
    let mut case = Case::new("interreflection", scene);
    case.shoot(&[fringe(Axis::X, 48.0), Pattern::White {}]);
    case
}

/// Returns a case with a moving object, a deforming object, and a rolling shutter.
pub fn motion(folder: &Path) -> Case {
    for (name, height) in [("out", 0.0), ("in", 12.0)] {
        std::fs::write(folder.join(format!("{name}.obj")), hill(height)).unwrap();
    }
    let scene =
        "ambient = { irradiance_w_m2 = 0.05, flicker = { frequency_hz = 100, depth = 0.4 } }
[[object]]
shape = { kind = \"plane\" }
position_mm = [0, 0, 1150]
albedo = 0.8
[[object]]
shape = { kind = \"sphere\", radius_mm = 45.0 }
position_mm = [-90, 0, 1000]
albedo = 0.7
motion = { keyframes = [
    { time_s = 0.0 },
    { time_s = 0.1, position_mm = [8.0, 0.0, -10.0] },
] }
[[object]]
shape = { kind = \"mesh\", file = \"out.obj\" }
position_mm = [60, 0, 1050]
albedo = 0.7
deform = { period_s = 0.2, keyframes = [
    { time_s = 0.0, file = \"out.obj\" },
    { time_s = 0.1, file = \"in.obj\" },
] }
";
    let mut case = Case::with("motion", "pmp-bench", scene, folder, |_| {});
    case.options.time_samples = 3;
    case
}

/// Returns a mesh of a wall of 200 mm with a hill of this height in the centre, towards the camera.
fn hill(height: f64) -> String {
    const N: usize = 24;
    let mut text = String::new();
    for i in 0..=N * (N + 2) {
        let at = |k: usize| k as f64 / N as f64 - 0.5;
        let (x, y) = (at(i % (N + 1)), at(i / (N + 1)));
        let z = -height * (-(x * x + y * y) / 0.04).exp();
        text += &format!("v {} {} {z}\n", 200.0 * x, 200.0 * y);
    }
    for row in 0..N {
        for column in 0..N {
            let a = row * (N + 1) + column + 1;
            let (b, c, d) = (a + 1, a + N + 1, a + N + 2);
            text += &format!("f {a} {c} {b}\nf {b} {c} {d}\n");
        }
    }
    text
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_matches_cpu_for_a_real_bench() {
    agree(&real_bench());
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_matches_cpu_for_response_curves_and_blooming() {
    agree(&bent());
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_matches_cpu_for_textures_highlights_and_lamps() {
    let folder = tempfile::tempdir().unwrap();
    agree(&looks(folder.path()));
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_matches_cpu_for_skin() {
    agree(&skin());
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_matches_cpu_for_interreflection() {
    agree(&interreflection());
}

/// GPU and CPU agree for pattern timing, with a global shutter and with a rolling shutter in a
/// moving scene.
#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_matches_cpu_for_pattern_timing() {
    let mut case = timed();
    agree(&case);
    case = interreflection();
    case.name = "timed-bounces";
    case.time();
    agree(&case);
    let folder = tempfile::tempdir().unwrap();
    agree(&timed_rolling(folder.path()));
}

fn timed_rolling(folder: &Path) -> Case {
    let mut case = motion(folder);
    case.name = "timed-rolling";
    case.roll(12.0);
    case.time();
    case
}

fn timed() -> Case {
    let mut case = solids();
    case.name = "timed";
    case.shoot_image();
    case.time();
    case
}

/// Every term is used by a case; a term without a case would not be compared.
#[test]
fn every_term_has_a_case() {
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        real_bench(),
        bent(),
        looks(folder.path()),
        skin(),
        interreflection(),
        timed(),
        timed_rolling(folder.path()),
    ];
    let plans: Vec<Plan> = cases
        .iter()
        .map(|case| {
            let mut renderer = case.renderer(phasmid::emulator::render::Backend::Cpu);
            renderer.expect_pattern_images(
                case.shots
                    .iter()
                    .filter_map(|shot| shot.pattern_image.as_deref()),
            );
            renderer.plan()
        })
        .collect();
    for term in Term::ALL {
        assert!(plans.iter().any(|plan| plan.has(term)), "{term}");
    }
}
