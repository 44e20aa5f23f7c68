//! What each term of image formation costs alone, and each plan beside the full one.
//!
//! The paper's bench before its torso is timed with a usual parameter of the term and without, in
//! turns; beside it stands a memory copy of what the term's pass writes a pixel. A term that the
//! bench has anyway is left out once, and one that no parameter here asks for is forced in.
//!
//! `cargo bench --bench terms`

use phasma::cli::Timing;
use phasma::emulator::render::{Pass, Renderer, Term};
use phasma::emulator::{Firmware, Shot};
use phasma::profile::{
    CameraResponse, Flicker, Focus, Glare, Light, Profile, Response, Scene, Specular,
};
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

fn main() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    checks(&folder.path().join("checks.png"));
    println!(
        "{:<24}{:>10}{:>12}{:>12}{:>12}{:>10}",
        "term, alone", "pass", "ns/px off", "ns/px more", "copy ns/px", "ratio"
    );
    for term in Term::ALL {
        let (off, on) = (plain(folder.path()), needing(term, folder.path()));
        let pixels = off.0.camera.width_px as usize * off.0.camera.height_px as usize;
        let [off, on] = costs(term, &off, &on);
        let (pass, bytes) = match term.pass() {
            Pass::Geometry => ("geometry", GEOMETRY_BYTES),
            Pass::Exposure => ("exposure", FRAME_BYTES),
            Pass::Sensor => ("sensor", FRAME_BYTES),
        };
        let copy = copy_ns(pixels, bytes);
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
        plan(&format!("{name}, {scene}"), &profile, scene);
    }
    let (mut profile, mut scene) = plain(folder.path());
    // The pupil's samples would hide all else.
    for term in Term::ALL.into_iter().filter(|t| *t != Term::DepthOfField) {
        need(term, &mut profile, &mut scene);
    }
    plan("all of a profile, torso", &profile, "torso");
}

/// What the geometry pass writes a pixel: ten maps.
const GEOMETRY_BYTES: usize = 45;
/// What a frame reads and writes a pixel.
const FRAME_BYTES: usize = 21;

/// A line of the table of plans.
fn plan(name: &str, profile: &Profile, scene: &str) {
    let scene = Scene::load(scene).expect("built in");
    let shots = shots(profile);
    let mut renderer = renderer(profile, &scene, &shots);
    let plan = renderer.plan();
    let terms = Term::ALL.iter().filter(|term| plan.has(**term)).count();
    let mut timing = Timing::new(&mut renderer, &shots);
    let [geometry, frame] =
        [Pass::Geometry, Pass::Exposure].map(|pass| (timing.pass_ns(pass), timing.full_ns(pass)));
    println!(
        "{name:<28}{terms:>7}{:>14.2}{:>10.2}{:>14.2}{:>10.2}",
        geometry.0, geometry.1, frame.0, frame.1
    );
}

/// The paper's bench before a torso.
fn plain(folder: &Path) -> (Profile, Scene) {
    let mut scene = Scene::load("torso").expect("built in");
    scene.folder = folder.to_path_buf();
    (Profile::load("pmp-bench").expect("built in"), scene)
}

/// The same with a usual parameter of a term.
fn needing(term: Term, folder: &Path) -> (Profile, Scene) {
    let (mut profile, mut scene) = plain(folder);
    need(term, &mut profile, &mut scene);
    (profile, scene)
}

/// Nanoseconds a pixel of the pass of a term without and with it.
fn costs(term: Term, off: &(Profile, Scene), on: &(Profile, Scene)) -> [f64; 2] {
    let [mut off_shots, mut on_shots] = [shots(&off.0), shots(&on.0)];
    if term == Term::Motion {
        // One frame has its geometry to do, as all have.
        off_shots.truncate(1);
        on_shots.truncate(1);
    }
    let mut without = renderer(&off.0, &off.1, &off_shots);
    let mut timing = Timing::new(&mut without, &off_shots);
    if off == on {
        return timing.term_ns(term);
    }
    let mut with = renderer(&on.0, &on.1, &on_shots);
    timing.beside_ns(&mut Timing::new(&mut with, &on_shots), term.pass())
}

/// Gives profile and scene a usual parameter of a term.
fn need(term: Term, profile: &mut Profile, scene: &mut Scene) {
    let (camera, projector) = (&mut profile.camera, &mut profile.projector);
    let flicker = Some(Flicker {
        frequency_hz: 100,
        depth: 0.3,
        phase_deg: 0.0,
    });
    match term {
        Term::CameraDistortion => camera.distortion = [-0.1, 0.03, 5e-4, -3e-4, 0.0],
        Term::ProjectorDistortion => projector.distortion = [-0.05, 0.02, 3e-4, 4e-4, 0.0],
        Term::CameraVignetting => camera.vignetting.natural = true,
        Term::ProjectorVignetting => projector.vignetting.natural = true,
        Term::ProjectorDefocus => {
            projector.focus = Some(Focus {
                distance_mm: 1000.0,
                aperture_mm: 6.0,
            });
        }
        Term::DepthOfField => {
            camera.f_number = 4.0;
            camera.focus_mm = Some(1000.0);
        }
        Term::AlbedoMaps => {
            for object in &mut scene.object {
                object.texture = Some("checks.png".into());
                object.texture_size_mm = Some([100.0, 100.0]);
            }
        }
        Term::Specular => {
            for object in &mut scene.object {
                object.specular = Some(Specular {
                    f0: 0.028,
                    roughness: 0.5,
                });
            }
        }
        Term::Lights => scene.light.push(Light::Point {
            position_mm: [-300.0, -500.0, 200.0],
            intensity_w_sr: 0.1,
            flicker: None,
        }),
        Term::Subsurface => {
            for object in &mut scene.object {
                object.skin = Some(toml::from_str("fitzpatrick = 2").expect("a skin"));
            }
        }
        Term::Interreflection => {
            let bounce = toml::from_str("samples = 64").expect("an interreflection");
            scene.interreflection = Some(bounce);
        }
        // A breath of 10 mm: each frame has the geometry of four instants.
        Term::Motion => {
            let motion = "period_s = 4\n[[keyframes]]\ntime_s = 0\n\
                          [[keyframes]]\ntime_s = 2\nposition_mm = [0, 0, -10]";
            scene.object[1].motion = Some(toml::from_str(motion).expect("a motion"));
        }
        Term::ProjectorResponse => projector.response = Some(Response::Gamma(2.2)),
        Term::ContrastRatio => projector.contrast_ratio = Some(800.0),
        Term::Flicker => scene.ambient.flicker = flicker,
        // Half of the rows see the next slide too.
        Term::RollingShutter => camera.line_time_us = 8.0,
        // Patterns that last as long as their exposures: as many passes as before.
        Term::PatternTiming => {
            let led = "rise_us = 5\ndroop = [{ time_constant_s = 60, fraction = 0.1 }]";
            projector.led = Some(toml::from_str(led).expect("a light source"));
        }
        Term::Glare => {
            camera.glare = Some(Glare {
                percent: 2.0,
                sigma_px: 40.0,
            });
        }
        Term::DarkCurrent => camera.sensor.dark_current_e_s = 20.0,
        Term::FixedPattern => {
            camera.sensor.prnu_percent = 0.5;
            camera.sensor.dsnu_e = 1.5;
        }
        Term::Blooming => camera.sensor.blooming_percent = 5.0,
        Term::CameraResponse => camera.sensor.response = CameraResponse::Gamma { gamma: 2.2 },
        // What the bench has already, and what no parameter asks for.
        _ => {}
    }
}

/// The exposures of the profile's first sequence.
fn shots(profile: &Profile) -> Vec<Shot> {
    let firmware = Firmware::new(profile, &[]).expect("sound");
    let sequence = firmware.selected_sequence();
    sequence.into_iter().map(|(_, shot)| shot).collect()
}

fn renderer(profile: &Profile, scene: &Scene, shots: &[Shot]) -> Renderer {
    let mut renderer = Renderer::new(profile, scene, 1).expect("sound");
    renderer.expect_slides(shots.iter().filter_map(|shot| shot.slide.as_deref()));
    renderer
}

/// A texture of light and dark squares.
fn checks(path: &Path) {
    let square = |u: u32, v: u32| {
        image::Luma([if (u / 32 + v / 32).is_multiple_of(2) {
            255
        } else {
            90
        }])
    };
    let picture = image::GrayImage::from_fn(512, 512, square);
    picture.save(path).expect("a picture of 512 pixels");
}

/// Nanoseconds a pixel of a copy of so many bytes of each, the fastest of some.
fn copy_ns(pixels: usize, bytes_per_pixel: usize) -> f64 {
    let from = vec![1u8; pixels * bytes_per_pixel];
    let mut to = vec![0u8; from.len()];
    let mut once = || {
        let begin = Instant::now();
        black_box(&mut to).copy_from_slice(black_box(&from));
        begin.elapsed().as_secs_f64() * 1e9
    };
    (0..10).map(|_| once()).fold(f64::INFINITY, f64::min) / pixels as f64
}
