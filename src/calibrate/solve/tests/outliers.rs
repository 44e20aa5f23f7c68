//! Outlier points and inconsistent poses.

use super::super::{Choice, Coefficients, PoseSightings, Solution, Unfit, chi_square_bound, solve};
use super::scene::{Draws, Scene};
use glam::DVec2;
use phasmid_geometry::Board;

const CHOICE: Choice = Choice {
    camera: Coefficients::Fixed([false; 5]),
    projector: Coefficients::Fixed([false; 5]),
    robust: true,
};

fn scene() -> Scene {
    Scene {
        board: Board::CHESS.scaled(3.0),
        ..Scene::bench(8, 4)
    }
}

fn solved(scene: &Scene, sightings: &[PoseSightings]) -> Solution {
    let [camera, projector] = scene.sizes();
    solve(&scene.board, sightings, camera, projector, &CHOICE).unwrap()
}

#[test]
fn five_per_cent_of_outliers_leave_the_covariance_honest() {
    let scene = scene();
    let (mut squares, mut unknowns) = (0.0, 0);
    for seed in 0..30 {
        let mut sightings = scene.sightings(Some(seed));
        let mut draws = Draws::new(seed + 1000);
        let mut spoiled = [0, 0];
        for s in sightings.iter_mut().flat_map(|p| &mut p.sightings) {
            let off = DVec2::from_angle(draws.even() * 7.0) * (1.0 + 30.0 * draws.even());
            if draws.even() < 0.05 {
                s.camera_px += off;
                spoiled[0] += 1;
            } else if let Some(lit) = &mut s.projector
                && draws.even() < 0.05
            {
                lit.px += off;
                spoiled[1] += 1;
            }
        }
        let found = solved(&scene, &sightings);
        assert!(found.left_out.is_empty(), "{:?}", found.left_out);
        let points = || found.poses.iter().flat_map(|p| &p.points);
        let out = points().filter(|p| p.camera_weight == 0.0).count();
        assert_eq!(out, spoiled[0]);
        let (square, dof) = found.mahalanobis(&scene.rig, Some(&scene.boards));
        assert!(
            square < chi_square_bound(0.9999, dof),
            "seed {seed}: {square} {dof}"
        );
        assert!((found.variance_factor - 1.0).abs() < 0.3);
        squares += square;
        unknowns += dof;
    }
    assert!(
        squares < chi_square_bound(0.999, unknowns),
        "{squares} {unknowns}"
    );
    assert!(
        squares > chi_square_bound(0.001, unknowns),
        "{squares} {unknowns}"
    );
}

#[test]
fn inconsistent_pose_is_named_and_left_out() {
    let scene = scene();
    // One pose has a board of another size. The camera alone cannot detect this; camera and
    // projector together can.
    let mut sightings = scene.sightings(Some(1));
    let other = Scene {
        board: scene.board.scaled(1.1),
        ..scene.clone()
    };
    sightings[3] = other.sightings(Some(2)).swap_remove(3);
    let found = solved(&scene, &sightings);
    assert_eq!(found.left_out.len(), 1, "{:?}", found.left_out);
    let out = &found.left_out[0];
    assert_eq!((out.given, out.name.as_str()), (3, "pose_03"));
    assert!(matches!(out.why, Unfit::Misfit { .. }), "{}", out.why);
    let given: Vec<usize> = found.poses.iter().map(|p| p.given).collect();
    assert_eq!(given, [0, 1, 2, 4, 5, 6, 7]);
    let mut boards = scene.boards.clone();
    boards.remove(3);
    let (square, dof) = found.mahalanobis(&scene.rig, Some(&boards));
    assert!(square < chi_square_bound(0.999, dof), "{square} {dof}");
}

#[test]
fn poses_without_a_usable_board_are_named_and_left_out() {
    let scene = scene();
    let mut sightings = scene.sightings(Some(1));
    sightings[0].sightings.truncate(4);
    sightings[2].sightings.retain(|s| s.index[1] == 2);
    for s in &mut sightings[4].sightings {
        s.camera_px.x = 1137.0 - s.camera_px.x;
    }
    for lit in sightings[5]
        .sightings
        .iter_mut()
        .filter_map(|s| s.projector.as_mut())
    {
        lit.px.y = 1079.0 - lit.px.y;
    }
    sightings[6].sightings.clear();
    let found = solved(&scene, &sightings);
    let whys: Vec<_> = found
        .left_out
        .iter()
        .map(|l| (l.given, l.why.to_string()))
        .collect();
    let expect = [
        (0, "4 points"),
        (2, "on a line"),
        (4, "mirrored"),
        (5, "projector's coordinates lie mirrored"),
        (6, "0 points"),
    ];
    assert_eq!(whys.len(), expect.len(), "{whys:?}");
    for ((at, why), (place, words)) in whys.iter().zip(expect) {
        assert!(*at == place && why.contains(words), "{at}: {why}");
    }
    let boards = [1, 3, 7].map(|i| scene.boards[i]);
    let (square, dof) = found.mahalanobis(&scene.rig, Some(&boards));
    assert!(square < chi_square_bound(0.999, dof), "{square} {dof}");
    assert!(
        found
            .warnings
            .iter()
            .any(|w| w.contains("3 poses are used"))
    );
}

#[test]
fn a_point_without_light_counts_for_the_camera_only() {
    let scene = scene();
    let mut sightings = scene.sightings(None);
    let dark = &mut sightings[1].sightings;
    dark.iter_mut().for_each(|s| s.projector = None);
    let found = solved(&scene, &sightings);
    assert!(found.poses[1].points.iter().all(|p| p.projector.is_none()));
    assert_eq!(found.poses[1].projector_errors.count, 0);
    assert!(found.mahalanobis(&scene.rig, Some(&scene.boards)).0 < 1e-6);
}
