//! Calibrates the emulated scanner from its captures of a board, in one process, and compares the
//! result with the truth.
//!
//! `--nocapture` prints the figures.

mod desk;
mod figures;
mod seeds;

use desk::{Desk, shots};
use figures::Figures;
use phasmid::calibrate::solve::{Choice, chi_square_bound};
use phasmid::decode::{Decoder, Options};
use phasmid::emulator::render::Renderer;
use phasmid::geometry::board_poses::Wanted;
use phasmid::geometry::{Board, Rig};
use phasmid::pattern::Image;
use phasmid::profile::{Profile, Scene};
use phasmid::study::score::score;

/// Wu et al. report 0.03 px for the camera and 0.08 px for the projector over 20 poses.
#[test]
fn twenty_poses_of_the_bench_give_its_rig() {
    let desk = Desk::new("pmp-bench", Board::DOTS.scaled(4.0));
    let poses = desk.poses(&Wanted::default());
    let seen = desk.sight(&poses, 0);
    let calibration = desk.calibrate(&seen, Choice::default());
    let figures = Figures::new(&desk, &calibration, &poses);
    println!("{figures}");
    assert_eq!(
        (figures.poses, calibration.solution.left_out.len()),
        (20, 0)
    );
    assert!(figures.dots_px <= 0.012, "{figures}");
    assert!(
        figures.camera_px <= 0.015 && figures.projector_px <= 0.07,
        "{figures}"
    );
    for (distance, freedom) in [
        (figures.distance, figures.freedom),
        (figures.rig_distance, figures.rig_freedom),
    ] {
        assert!(distance <= chi_square_bound(0.99, freedom), "{figures}");
    }
    assert_eq!(calibration.warnings, Vec::<String>::new());
    assert!(calibration.rounds <= 4 && calibration.last_move_px <= 1e-5);

    let [truth, estimate] =
        [&desk.rig, &calibration.solution.rig].map(|rig| scan_error_mm(&desk, rig));
    println!("trapezoid: {truth:.4} mm with the true rig, {estimate:.4} mm with the estimate");
    assert!(estimate <= 1.5 * truth, "{estimate} {truth}");
}

/// Returns the mean absolute error of a scan of the trapezoid in millimetres.
fn scan_error_mm(desk: &Desk, rig: &Rig) -> f64 {
    let profile = &desk.profile;
    let scene = Scene::load("trapezoid").unwrap();
    let mut renderer = Renderer::new(profile, &scene, 1).unwrap();
    let manifest = profile.manifest(&profile.sequence[0]);
    let shots = shots(profile, &manifest);
    let frames: Vec<_> = shots.iter().map(|s| renderer.expose(s).data).collect();
    let patterns = manifest.frame.iter().map(|frame| frame.pattern.clone());
    let shown: Vec<_> = patterns.zip(shots).collect();
    let truth = renderer.truth(&shown);
    let (w, h) = (truth.width as usize, truth.height as usize);
    let decoder = Decoder::new(&manifest, w, h, Some(rig), Options::default()).unwrap();
    let images: Vec<_> = frames
        .iter()
        .map(|f| Image::new(w, h, f.clone()).unwrap())
        .collect();
    let decoded = decoder.decode(&images).unwrap();
    score(&decoded, &truth, &manifest, &desk.rig)
        .unwrap()
        .mae_mm
}

/// The board of Wu et al., whose dots have a size of 3.2 px here, gives the rig at 500 mm.
#[test]
fn board_of_the_paper_at_500_mm_gives_the_rig() {
    let mut profile = Profile::load("pmp-bench").unwrap();
    // At half the distance the light is four times as bright, so the exposure is shortened.
    profile.camera.exposure_us /= 4.0;
    let desk = Desk::of(profile, Board::DOTS);
    let poses = desk.poses(&Wanted {
        distance_mm: Some(500.0),
        tilt_deg: [5.0, 30.0],
        reach: [0.9, 1.1],
        least_dot_px: 2.3,
        ..Wanted::default()
    });
    let seen = desk.sight(&poses, 0);
    let calibration = desk.calibrate(&seen, Choice::default());
    let figures = Figures::new(&desk, &calibration, &poses);
    println!("{figures}");
    assert_eq!(figures.poses, 20);
    // Dots lit only by ambient light are noisy in such a short exposure.
    assert!(figures.dots_px <= 0.03, "{figures}");
    assert!(
        figures.distance <= chi_square_bound(0.99, figures.freedom),
        "{figures}"
    );
    assert!(
        figures.camera_px <= 0.015 && figures.projector_px <= 0.07,
        "{figures}"
    );
}

/// The rig is found with distorting, blurring lenses, glare, and a sensor with fixed-pattern noise.
#[test]
#[ignore = "a minute: every dot has a blur of its own"]
fn calibration_of_a_scanner_with_real_parts_is_accurate() {
    let desk = Desk::new("pmp-real", Board::DOTS.scaled(4.0));
    let poses = desk.poses(&Wanted::default());
    let seen = desk.sight(&poses, 0);
    let calibration = desk.calibrate(&seen, Choice::default());
    let figures = Figures::new(&desk, &calibration, &poses);
    println!("{figures}");
    assert_eq!(figures.poses, 20);
    assert!(
        figures.camera_px <= 0.015 && figures.projector_px <= 0.07,
        "{figures}"
    );
    let [truth, estimate] =
        [&desk.rig, &calibration.solution.rig].map(|rig| scan_error_mm(&desk, rig));
    println!("trapezoid: {truth:.4} mm with the true rig, {estimate:.4} mm with the estimate");
    assert!(estimate <= 1.5 * truth, "{estimate} {truth}");
}

#[test]
fn built_in_profiles_name_a_calibration_sequence() {
    for name in ["pmp-bench", "pmp-real", "webcam-grey"] {
        assert!(
            Profile::load(name)
                .unwrap()
                .calibration_sequence()
                .is_some()
        );
    }
}
