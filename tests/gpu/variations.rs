//! GPU and CPU agree for further cases of terms that [`crate::terms`] already covers; only for full
//! runs.

use crate::case::Case;
use crate::compare::agree;
use crate::terms::{SOLIDS, fringe, motion, real, solids, torso};
use phasmid::pattern::Axis;
use std::path::Path;

fn boards() -> Case {
    let mut case = real(
        "boards",
        "ambient = { irradiance_w_m2 = 0.05 }
[[object]]
shape = { kind = \"board\", board = { pattern = \"dots\", columns = 25, rows = 19, pitch_mm = 24.0, dot_mm = 10.0, marker_mm = 20.0 } }
position_mm = [0, 0, 1050]
rotation_deg = [5, -32, 2]
albedo = 0.8
[[object]]
shape = { kind = \"board\", board = { pattern = \"chess\", columns = 9, rows = 6, pitch_mm = 12.0 } }
position_mm = [-70, 0, 900]
rotation_deg = [40, 10, 0]
albedo = 0.7
specular = { f0 = 0.04, roughness = 0.35 }
",
        |_| {},
    );
    case.shoot_image();
    case
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_matches_cpu_for_every_solid_and_pattern_image() {
    agree(&solids());
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_matches_cpu_for_a_mesh() {
    agree(&Case::new("mesh", &torso("")));
}

/// GPU and CPU agree for both focuses, both vignettings and glare, through lenses with different fx
/// and fy.
#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_matches_cpu_for_pixels_that_are_not_square() {
    let mut case = real("pixel-aspect", SOLIDS, |profile| {
        profile.camera.pixel_aspect = 1.3;
        profile.projector.pixel_aspect = 0.75;
    });
    case.shoot(&[fringe(Axis::X, 16.0), fringe(Axis::Y, 24.0)]);
    case.shoot_image();
    agree(&case);
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_matches_cpu_for_boards() {
    agree(&boards());
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_matches_cpu_for_motion_and_deformation() {
    let folder = tempfile::tempdir().unwrap();
    agree(&motion(folder.path()));
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_matches_cpu_for_rolling_shutter_and_motion() {
    let folder = tempfile::tempdir().unwrap();
    let mut case = motion(folder.path());
    case.name = "rolling";
    case.roll(12.0);
    agree(&case);
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_matches_cpu_for_several_rays_a_pixel() {
    for samples in [4, 16, 64] {
        let mut case = solids();
        case.name = "samples";
        case.options.samples = samples;
        case.shots.truncate(1);
        agree(&case);
    }
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_matches_cpu_far_out_of_focus() {
    let mut case = real("defocus", SOLIDS, |profile| {
        profile.camera.f_number = 2.0;
        profile.camera.focus_mm = Some(850.0);
        // The lower quantum efficiency makes the image as bright as at f/16.
        profile.camera.sensor.quantum_efficiency /= 64.0;
    });
    case.shots.truncate(1);
    agree(&case);
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_matches_cpu_without_noise() {
    let mut case = Case::with(
        "no-noise",
        "pmp-bench",
        &torso(""),
        Path::new("."),
        |profile| {
            profile.camera.sensor.noiseless = true;
        },
    );
    case.shots.truncate(1);
    agree(&case);
}
