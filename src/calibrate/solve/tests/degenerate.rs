//! Observations that do not determine a rig give an error that contains numbers.

use super::super::{Choice, Coefficients, PoseSightings, Solution, Unsolved, solve};
use super::scene::{Scene, poses};
use crate::board::{Lit, Sighting};
use glam::{DMat2, DMat3, DVec2, DVec3};
use phasmid_geometry::{Board, Pose};

fn scene(boards: Vec<Pose>) -> Scene {
    Scene {
        board: Board::CHESS.scaled(3.0),
        boards,
        ..Scene::bench(1, 0)
    }
}

fn solved(scene: &Scene, sightings: &[PoseSightings]) -> Result<Solution, Unsolved> {
    let [camera, projector] = scene.sizes();
    solve(
        &scene.board,
        sightings,
        camera,
        projector,
        &Choice::default(),
    )
}

#[test]
fn one_pose_and_none_are_too_few() {
    let scene = scene(poses(1, 1000.0, 0));
    for sightings in [scene.sightings(Some(0)), Vec::new()] {
        let refusal = solved(&scene, &sightings).unwrap_err();
        assert!(matches!(refusal, Unsolved::TooFewPoses { .. }), "{refusal}");
        assert!(
            refusal.to_string().contains("2 or more tilted"),
            "{refusal}"
        );
    }
}

#[test]
fn refuses_parallel_boards_and_names_the_angle() {
    for (tilt, seed) in [(0.0, None), (30.0, None), (0.0, Some(1)), (30.0, Some(2))] {
        let boards = (0..6)
            .map(|i| {
                let i = f64::from(i);
                let place = DVec3::new(20.0 * i - 50.0, 9.0 * i - 30.0, 900.0 + 40.0 * i);
                Pose::from_xyz_deg(place, DVec3::new(0.0, tilt, 0.0))
            })
            .collect();
        let scene = scene(boards);
        let refusal = solved(&scene, &scene.sightings(seed)).unwrap_err();
        assert!(
            matches!(refusal, Unsolved::Parallel { .. }),
            "{tilt} {seed:?}: {refusal}"
        );
        let text = refusal.to_string();
        assert!(
            text.contains("degrees") && text.contains("15 degrees or more"),
            "{text}"
        );
    }
}

/// The tilt is large enough for the closed form but too small for bundle adjustment.
#[test]
fn refuses_hardly_tilted_boards_and_names_the_angle() {
    let boards = (0..6)
        .map(|i| {
            let azimuth = 2.399_963 * f64::from(i);
            let axis = DVec3::new(azimuth.cos(), azimuth.sin(), 0.0);
            let i = f64::from(i);
            Pose {
                rotation: DMat3::from_axis_angle(axis, 0.35_f64.to_radians()),
                translation_mm: DVec3::new(40.0 * i - 100.0, 6.0 * i - 15.0, 900.0 + 45.0 * i),
            }
        })
        .collect();
    let scene = scene(boards);
    let mut refused = 0;
    for seed in 0..4 {
        if let Err(refusal) = solved(&scene, &scene.sightings(Some(seed))) {
            refused += 1;
            assert!(matches!(refusal, Unsolved::Parallel { .. }), "{refusal}");
            let text = refusal.to_string();
            assert!(
                text.contains("degrees") && text.contains("15 degrees") && !text.contains("NaN"),
                "{text}"
            );
        }
    }
    assert!(refused >= 3, "{refused} of 4");
}

#[test]
fn refuses_points_finer_than_rounding() {
    let scene = Scene {
        noise: [1e-10; 2],
        ..scene(poses(6, 1000.0, 4))
    };
    let refusal = solved(&scene, &scene.sightings(Some(1))).unwrap_err();
    let text = refusal.to_string();
    assert!(
        text.contains("finer than rounding") && !text.contains("tilted"),
        "{text}"
    );
}

#[test]
fn refuses_mirrored_images_and_coordinates() {
    let scene = scene(poses(5, 1000.0, 1));
    let mut flipped = scene.sightings(Some(1));
    for s in flipped.iter_mut().flat_map(|p| &mut p.sightings) {
        s.camera_px.x = 1137.0 - s.camera_px.x;
    }
    let refusal = solved(&scene, &flipped).unwrap_err().to_string();
    assert!(
        refusal.contains("the camera shows the board mirrored in 5 of 5"),
        "{refusal}"
    );
    let mut crossed = scene.sightings(Some(1));
    for s in crossed.iter_mut().flat_map(|p| &mut p.sightings) {
        if let Some(lit) = &mut s.projector {
            lit.px.x = 1919.0 - lit.px.x;
        }
    }
    let refusal = solved(&scene, &crossed).unwrap_err().to_string();
    assert!(
        refusal.contains("lie mirrored on the board in 5 of 5"),
        "{refusal}"
    );
}

#[test]
fn refuses_unlit_boards_and_random_labels() {
    let scene = scene(poses(6, 1000.0, 2));
    let mut dark = scene.sightings(Some(1));
    for s in dark.iter_mut().flat_map(|p| &mut p.sightings) {
        s.projector = None;
    }
    let refusal = solved(&scene, &dark).unwrap_err();
    assert!(matches!(refusal, Unsolved::Unlit { .. }), "{refusal}");
    // Give points the indices of other points.
    let mut mixed = scene.sightings(Some(1));
    for pose in &mut mixed {
        let count = pose.sightings.len();
        for i in 0..count {
            pose.sightings[i].index = pose.sightings[(i * 31 + 7) % count].index;
        }
    }
    let refusal = solved(&scene, &mixed).unwrap_err();
    let named = matches!(
        refusal,
        Unsolved::TooFewPoses { .. } | Unsolved::Undetermined { .. }
    );
    assert!(named, "{refusal}");
}

#[test]
fn two_poses_are_enough_but_not_without_a_warning() {
    let scene = scene(poses(2, 1000.0, 3));
    let choice = Choice {
        camera: Coefficients::Fixed([false; 5]),
        projector: Coefficients::Fixed([false; 5]),
        robust: true,
    };
    let [camera, projector] = scene.sizes();
    let found = solve(
        &scene.board,
        &scene.sightings(Some(1)),
        camera,
        projector,
        &choice,
    )
    .unwrap();
    assert!(
        found
            .warnings
            .iter()
            .any(|w| w.contains("2 poses are used; expected 5"))
    );
    assert!(
        found
            .warnings
            .iter()
            .any(|w| w.contains("cells of the camera's image"))
    );
    let (square, dof) = found.mahalanobis(&scene.rig, Some(&scene.boards));
    assert!(square < 3.0 * dof as f64, "{square} {dof}");
}

/// Invalid and extreme numbers cause no panic.
#[test]
fn invalid_and_extreme_numbers_do_not_panic() {
    let scene = scene(poses(4, 1000.0, 1));
    let whole = scene.sightings(Some(1));
    let spoilers: [fn(&mut Sighting); 12] = [
        |s| s.camera_px.x = f64::NAN,
        |s| s.camera_px = DVec2::ZERO,
        |s| s.camera_px *= 1e300,
        |s| s.camera_px *= 1e-300,
        |s| s.camera_covariance = DMat2::ZERO,
        |s| s.camera_covariance *= 1e-300,
        |s| s.camera_covariance *= 1e300,
        |s| s.index = [u32::MAX, 0],
        |s| s.index = [0, 0],
        |s| s.projector.iter_mut().for_each(|l| l.px = DVec2::INFINITY),
        |s| s.projector.iter_mut().for_each(|l| l.slope *= 1e200),
        |s| {
            s.projector
                .iter_mut()
                .for_each(|l| l.px = s.camera_px * 1e-200)
        },
    ];
    for spoil in spoilers {
        for share in [1, 2, 40] {
            let mut sightings = whole.clone();
            let all = sightings.iter_mut().flat_map(|p| &mut p.sightings);
            all.step_by(share).for_each(spoil);
            let _ = solved(&scene, &sightings);
        }
    }
    for size in [[0, 0], [1, 1], [u32::MAX, 1]] {
        let _ = solve(&scene.board, &whole, size, size, &Choice::default());
    }
    let many = vec![whole[0].clone(); 501];
    let refusal = solved(&scene, &many).unwrap_err();
    assert!(matches!(refusal, Unsolved::TooManyPoses { .. }));
    let one = Lit {
        px: DVec2::ONE,
        slope: DMat2::ZERO,
        covariance: DMat2::IDENTITY,
    };
    let mut same = whole;
    for s in same.iter_mut().flat_map(|p| &mut p.sightings) {
        s.projector = Some(one);
    }
    assert!(solved(&scene, &same).is_err());
}
