//! Rendered frames through the decoder against the device's truth, in one process: the bars that
//! the demo is held to.

use phasma::decode::{Decoder, FrameStack, Options, Samples};
use phasma::emulator::render::Renderer;
use phasma::emulator::{Shot, Slide};
use phasma::profile::{Profile, Scene};
use phasma::study::score::{Score, score};
use std::sync::Arc;

fn scan(profile: &str, scene: &str, seed: u64, noise: bool) -> Score {
    let profile = Profile::load(profile).unwrap();
    let scene = Scene::load(scene).unwrap();
    let mut renderer = Renderer::new(&profile, &scene, seed, noise).unwrap();
    let manifest = profile.manifest(&profile.sequence[0]);
    let shots: Vec<_> = manifest
        .frame
        .iter()
        .enumerate()
        .map(|(i, f)| {
            let slide = Slide::new(&f.pattern, &profile.projector, &|_| unreachable!()).unwrap();
            let shot = Shot {
                id: i as u64,
                pattern_index: Some(i as u32),
                slide: Some(Arc::new(slide)),
                light: 1.0,
                start_ns: 0,
                exposure_ns: (profile.camera.exposure_us * 1e3) as u64,
                gain_db: 0.0,
            };
            (f.pattern.clone(), shot)
        })
        .collect();
    let frames: Vec<_> = shots.iter().map(|(_, s)| renderer.expose(s).data).collect();
    let truth = renderer.truth(&shots);
    let rig = profile.nominal_rig();
    let (w, h) = (truth.width as usize, truth.height as usize);
    let decoder = Decoder::new(&manifest, w, h, Some(&rig), Options::default()).unwrap();
    let samples = frames.iter().map(|f| Samples::U8(f)).collect();
    let decoded = decoder
        .decode(&FrameStack::new(w, h, samples).unwrap())
        .unwrap();
    let score = score(&decoded, &truth, &manifest, &rig).unwrap();
    println!("{} {} noise {noise}: {score:#?}", profile.name, scene.name);
    score
}

#[test]
fn trapezoid_with_default_noise() {
    let s = scan("pmp-bench", "trapezoid", 1, true);
    assert!(s.mae_mm <= 0.035 && s.gross_error_rate <= 0.001, "{s:?}");
    assert!(s.coverage >= 0.97 && s.ratio_to_bound <= 1.15, "{s:?}");
}

#[test]
fn trapezoid_without_noise() {
    let s = scan("pmp-bench", "trapezoid", 1, false);
    assert!(s.mae_mm <= 0.012 && s.gross_error_rate <= 0.001, "{s:?}");
}

#[test]
fn other_scenes_and_the_webcam() {
    for scene in ["torso", "sphere", "plane", "couch"] {
        let s = scan("pmp-bench", scene, 2, true);
        assert!(
            s.gross_error_rate <= 0.001 && s.coverage >= 0.95,
            "{scene} {s:?}"
        );
        assert!(s.ratio_to_bound <= 1.25, "{scene} {s:?}");
    }
    let s = scan("webcam-grey", "sphere", 3, true);
    assert!(s.gross_error_rate <= 0.005 && s.coverage >= 0.9, "{s:?}");
}
