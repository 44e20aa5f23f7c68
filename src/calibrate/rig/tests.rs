//! Tests of the calibration after detection, on simulated points and maps of a known rig.

use super::*;
use crate::board::bias::of_disc;
use crate::board::lit::case::{Case, Random, rig};
use crate::board::lit::{Unread, local_fits};
use crate::board::{BoardImage, NotFound, search};
use crate::solve::Unsolved;
use glam::{DMat2, DVec3};
use phasmid_core::Stop;
use phasmid_geometry::Pose;

const BOARD: Board = Board::Dots {
    columns: 9,
    rows: 7,
    pitch_mm: 50.0,
    dot_mm: 20.0,
    marker_mm: 36.0,
};
const NOISE_PX: f64 = 0.003;

/// Creates poses with noise in the points ([`NOISE_PX`] times `noise`) and in the decoded maps.
fn poses(noise: f64, count: usize) -> Vec<(Case, PoseData)> {
    let rig = rig(220.0, [400, 240]);
    let one = |i: usize| {
        let around = i as f64 * 2.4;
        let tilt = DVec3::new(
            30.0 * around.cos(),
            30.0 * around.sin(),
            8.0 * i as f64 - 30.0,
        );
        let place = DVec3::new(
            15.0 * around.sin(),
            10.0 * around.cos(),
            1000.0 + 20.0 * i as f64,
        );
        let mut case = Case::new(rig, Pose::from_xyz_deg(place, tilt), BOARD);
        let mut random = Random(i as u64 + 100);
        for seen in &mut case.seen {
            let centre = BOARD.point(seen.index);
            let radius = BOARD.radius_mm(seen.index);
            let bias = of_disc(&rig.camera.lens, &case.pose, centre, radius).unwrap();
            let error = [random.normal(), random.normal()].map(|e| e * NOISE_PX * noise);
            seen.px += bias + glam::DVec2::from(error);
            seen.covariance = DMat2::IDENTITY * NOISE_PX.powi(2);
        }
        let decoded = case.decoded(noise, i as u64, |_, _| ());
        let pose = PoseData {
            name: format!("pose {i}"),
            seen: case.seen.clone(),
            fits: local_fits(&BOARD, &case.seen, &decoded),
        };
        (case, pose)
    };
    (0..count).map(one).collect()
}

fn task<'a>(board: &'a Board, nominal: &'a Rig) -> Task<'a> {
    Task {
        board,
        camera_px: [400, 240],
        projector_px: [1920, 1080],
        nominal: Some(nominal),
        noise: None,
        choice: Choice::default(),
        stop: None,
    }
}

#[test]
fn corrects_bias_of_dots_and_recovers_rig() {
    let (cases, poses): (Vec<_>, Vec<_>) = poses(1.0, 10).into_iter().unzip();
    let truth = cases[0].rig;
    let noise = NoiseModel {
        gain_dn_per_e: 0.02,
        read_noise_dn: 0.1,
        black_level_dn: 4.0,
        saturation_dn: 255.0,
    };
    let missed = vec![Missed {
        name: "pose 11".to_owned(),
        why: Unusable::Invalid("no images".to_owned()),
    }];
    let task = Task {
        noise: Some(noise),
        ..task(&BOARD, &truth)
    };
    let found = calibrate(&task, &poses, missed.clone()).unwrap();
    assert_eq!(
        (found.missed, found.solution.rig.noise),
        (missed, Some(noise))
    );
    assert!(
        found.rounds <= 4 && found.last_move_px <= 1e-5,
        "{}",
        found.rounds
    );
    assert!(found.largest_bias_px > 0.02, "{}", found.largest_bias_px);
    assert_eq!(found.solution.left_out, []);
    let (mut sum, mut count) = (0.0, 0.0);
    for (case, given) in cases.iter().zip(&found.sightings) {
        for sighting in &given.sightings {
            let p = case.pose.point(BOARD.point(sighting.index).extend(0.0));
            let off = sighting.camera_px - truth.camera.project(p).unwrap();
            sum += off.length_squared() / 2.0;
            count += 1.0;
        }
    }
    let rms = f64::sqrt(sum / count);
    assert!((rms / NOISE_PX - 1.0).abs() < 0.15, "{rms}");
    let boards: Vec<_> = cases.iter().map(|case| case.pose).collect();
    let (distance, freedom) = found.solution.mahalanobis(&truth, Some(&boards));
    println!(
        "{distance:.1} of {freedom}, bias {:.4} px",
        found.largest_bias_px
    );
    // The limit is four standard deviations above the expected value.
    let freedom = freedom as f64;
    assert!(
        distance < freedom + 4.0 * (2.0 * freedom).sqrt(),
        "{distance} {freedom}"
    );
}

#[test]
fn board_of_another_size_gives_a_warning_about_the_baseline() {
    let (cases, poses): (Vec<_>, Vec<_>) = poses(1.0, 6).into_iter().unzip();
    let truth = cases[0].rig;
    let said = BOARD.scaled(0.25);
    let found = calibrate(&task(&said, &truth), &poses, vec![]).unwrap();
    let told = |w: &&String| w.contains("0.250 times the nominal 400.00 mm") && w.contains("4.00");
    assert_eq!(
        found.warnings.iter().filter(told).count(),
        1,
        "{:?}",
        found.warnings
    );
}

#[test]
fn refuses_poses_that_determine_no_rig() {
    let (cases, mut poses): (Vec<_>, Vec<_>) = poses(1.0, 4).into_iter().unzip();
    let truth = cases[0].rig;
    let solve = |poses: &[PoseData]| calibrate(&task(&BOARD, &truth), poses, vec![]);
    assert!(matches!(solve(&[]), Err(Unsolved::TooFewPoses { .. })));
    assert!(matches!(
        solve(&poses[..1]),
        Err(Unsolved::TooFewPoses { .. })
    ));
    for pose in &mut poses {
        pose.fits.fill(Err(Unread::Scattered));
    }
    let why = solve(&poses).unwrap_err();
    assert!(matches!(why, Unsolved::Unlit { .. }));
    let why = why.to_string();
    assert!(why.contains("contradict each other"), "{why}");
    for pose in &mut poses {
        pose.seen.clear();
        pose.fits.clear();
    }
    assert!(solve(&poses).is_err());
}

#[test]
fn calibration_and_detection_end_when_asked() {
    let (cases, seen): (Vec<_>, Vec<_>) = poses(1.0, 4).into_iter().unzip();
    let stop = Stop::default();
    stop.ask();
    let task = Task {
        stop: Some(&stop),
        ..task(&BOARD, &cases[0].rig)
    };
    assert_eq!(calibrate(&task, &seen, vec![]), Err(Unsolved::Interrupted));
    let image = BoardImage {
        width: 64,
        height: 64,
        level: vec![100.0; 64 * 64],
        variance: vec![1.0; 64 * 64],
    };
    for board in [BOARD, Board::CHESS] {
        let found = search(&board, &image, &stop);
        assert_eq!(found, Err(NotFound::Interrupted));
    }
}
