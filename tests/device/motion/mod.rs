//! Moving scenes compared with closed forms, and with still scenes in the same position.

mod closed_form;
mod instants;
mod still;

use phasmid::emulator::render::{Options, Renderer};
use phasmid::emulator::{PatternImage, Shot};
use phasmid::pattern::{Axis, Pattern};
use phasmid::profile::{Profile, Scene};
use std::path::Path;
use std::sync::Arc;

const MS: u64 = 1_000_000;

/// Parses a scene from a few lines of TOML. The files that it refers to are in `folder`.
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

fn fringe(profile: &Profile, period_px: f64, phase_rad: f64) -> (Pattern, Arc<PatternImage>) {
    let pattern = Pattern::Fringe {
        axis: Axis::X,
        period_px,
        phase_rad,
    };
    let pattern_image =
        PatternImage::new(&pattern, &profile.projector, &|_| unreachable!()).unwrap();
    (pattern, Arc::new(pattern_image))
}

fn shot(pattern_image: &Arc<PatternImage>, start_ns: u64, exposure_ns: u64) -> Shot {
    Shot {
        pattern_image: Some(pattern_image.clone()),
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
