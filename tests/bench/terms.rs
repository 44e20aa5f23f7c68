//! Measures the cost of each term of image formation on its own, and compares plans with the full
//! plan.
//!
//! Times the bench of Wu et al. in front of a torso, alternately with and without a typical
//! parameter that enables the term, and compares the cost with a memory copy of the data of the
//! term's pass. A term that this bench always has is disabled for the comparison. A term that no
//! parameter of this benchmark enables is forced on.
//!
//! `cargo bench --bench terms`

use phasmid::emulator::render::{Pass, Renderer, Term};
use phasmid::emulator::{Firmware, Shot};
use phasmid::profile::{Profile, Scene};
use phasmid::study::timing::{Stopwatch, Timing};
use phasmid::study::work_precision::{CHECKS, checks, need};
use std::path::Path;
use std::time::Instant;

fn main() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let image = checks().expect("an image of 512 pixels");
    std::fs::write(folder.path().join(CHECKS), image).expect("a scratch folder");
    let begin = Instant::now();
    let clock = || begin.elapsed();
    let watch = Stopwatch::new(&clock);
    println!(
        "{:<24}{:>10}{:>12}{:>12}{:>12}{:>10}",
        "term, alone", "pass", "ns/px off", "ns/px more", "copy ns/px", "ratio"
    );
    for term in Term::ALL {
        let (off, on) = (plain(folder.path()), needing(term, folder.path()));
        let pixels = off.0.camera.width_px as usize * off.0.camera.height_px as usize;
        let [off, on] = costs(watch, term, &off, &on);
        let (pass, bytes) = match term.pass() {
            Pass::Geometry => ("geometry", GEOMETRY_BYTES),
            Pass::Exposure => ("exposure", FRAME_BYTES),
            Pass::Sensor => ("sensor", FRAME_BYTES),
        };
        let copy = copy_ns(watch, pixels, bytes);
        let (term, more) = (term.to_string(), on - off);
        let ratio = more / copy;
        println!("{term:<24}{pass:>10}{off:>12.2}{more:>12.2}{copy:>12.2}{ratio:>10.1}");
    }
    println!(
        "\n{:<28}{:>7}{:>14}{:>10}{:>14}{:>10}",
        "plan, ns/px", "terms", "geometry", "full", "frame", "full"
    );
    for (name, scene) in [
        ("pmp-bench", "plane"),
        ("pmp-bench", "trapezoid"),
        ("pmp-bench", "torso"),
        ("webcam-grey", "couch"),
    ] {
        let profile = Profile::load(name).expect("built in");
        plan(watch, &format!("{name}, {scene}"), &profile, scene);
    }
    let (mut profile, mut scene) = plain(folder.path());
    // Leave depth of field out, because the cost of the pupil's samples would hide all other costs.
    for term in Term::ALL.into_iter().filter(|t| *t != Term::DepthOfField) {
        need(term, &mut profile, &mut scene);
    }
    plan(watch, "all of a profile, torso", &profile, "torso");
}

/// Bytes per pixel that the geometry pass writes, in ten maps.
const GEOMETRY_BYTES: usize = 45;
/// Bytes per pixel that the passes of a frame read and write.
const FRAME_BYTES: usize = 21;

/// Prints a line of the table of plans.
fn plan(watch: Stopwatch<'_>, name: &str, profile: &Profile, scene: &str) {
    let scene = Scene::load(scene).expect("built in");
    let shots = shots(profile);
    let mut renderer = renderer(profile, &scene, &shots);
    let plan = renderer.plan();
    let terms = Term::ALL.iter().filter(|term| plan.has(**term)).count();
    let mut timing = Timing::new(&mut renderer, &shots, watch);
    let [geometry, frame] =
        [Pass::Geometry, Pass::Exposure].map(|pass| (timing.pass_ns(pass), timing.full_ns(pass)));
    println!(
        "{name:<28}{terms:>7}{:>14.2}{:>10.2}{:>14.2}{:>10.2}",
        geometry.0, geometry.1, frame.0, frame.1
    );
}

/// Returns the bench of Wu et al. and a torso in front of it.
fn plain(folder: &Path) -> (Profile, Scene) {
    let mut scene = Scene::load("torso").expect("built in");
    scene.folder = folder.to_path_buf();
    (Profile::load("pmp-bench").expect("built in"), scene)
}

/// Returns [`plain`] with a typical parameter that enables a term.
fn needing(term: Term, folder: &Path) -> (Profile, Scene) {
    let (mut profile, mut scene) = plain(folder);
    need(term, &mut profile, &mut scene);
    (profile, scene)
}

/// Returns the nanoseconds per pixel of a term's pass, without and with the term.
fn costs(
    watch: Stopwatch<'_>,
    term: Term,
    off: &(Profile, Scene),
    on: &(Profile, Scene),
) -> [f64; 2] {
    let [mut off_shots, mut on_shots] = [shots(&off.0), shots(&on.0)];
    if term == Term::Motion {
        // A moving scene needs its geometry pass in every frame, a still scene only in the first
        // frame, so one frame of each is compared.
        off_shots.truncate(1);
        on_shots.truncate(1);
    }
    let mut without = renderer(&off.0, &off.1, &off_shots);
    let mut timing = Timing::new(&mut without, &off_shots, watch);
    if off == on {
        return timing.term_ns(term);
    }
    let mut with = renderer(&on.0, &on.1, &on_shots);
    timing.beside_ns(&mut Timing::new(&mut with, &on_shots, watch), term.pass())
}

/// Returns the shots of the profile's first sequence.
fn shots(profile: &Profile) -> Vec<Shot> {
    let firmware = Firmware::new(profile, &[]).expect("sound");
    let sequence = firmware.selected_sequence();
    sequence.into_iter().map(|(_, shot)| shot).collect()
}

fn renderer(profile: &Profile, scene: &Scene, shots: &[Shot]) -> Renderer {
    let mut renderer = Renderer::new(profile, scene, 1).expect("sound");
    renderer.expect_pattern_images(
        shots
            .iter()
            .filter_map(|shot| shot.pattern_image.as_deref()),
    );
    renderer
}

/// Returns the nanoseconds per pixel of a memory copy of `bytes_per_pixel` bytes per pixel.
fn copy_ns(watch: Stopwatch<'_>, pixels: usize, bytes_per_pixel: usize) -> f64 {
    watch.seconds_a_copy(pixels * bytes_per_pixel) * 1e9 / pixels as f64
}
