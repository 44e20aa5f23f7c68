//! Automatic selection of distortion coefficients.

use super::super::{Choice, Coefficients, chi_square_bound, solve};
use super::scene::{Scene, rig};
use phasmid_geometry::Board;

#[test]
fn lenses_without_distortion_get_no_coefficients() {
    let scene = Scene {
        board: Board::CHESS.scaled(3.0),
        ..Scene::bench(6, 2)
    };
    let [camera, projector] = scene.sizes();
    let count = 100;
    let kept = (0..count)
        .filter(|seed| {
            let sightings = scene.sightings(Some(5000 + seed));
            let found = solve(
                &scene.board,
                &sightings,
                camera,
                projector,
                &Choice::default(),
            )
            .unwrap();
            found.camera_coefficients != [false; 5] || found.projector_coefficients != [false; 5]
        })
        .count();
    // Each of the two k1 is kept by chance with a probability of 0.001.
    assert!(kept <= 1, "{kept} of {count}");
}

#[test]
fn lenses_with_distortion_get_enough() {
    let scene = Scene {
        rig: rig("pmp-real"),
        ..Scene::bench(10, 1)
    };
    let [camera, projector] = scene.sizes();
    for seed in 0..3 {
        let sightings = scene.sightings(Some(seed));
        let found = solve(
            &scene.board,
            &sightings,
            camera,
            projector,
            &Choice::default(),
        )
        .unwrap();
        // The true k1 k2 p1 p2 of the camera and k1 k2 p2 of the projector are nonzero; k3 is zero.
        assert_eq!(found.camera_coefficients, [true, true, true, true, false]);
        assert_eq!(
            found.projector_coefficients,
            [true, true, true, true, false]
        );
        let (square, dof) = found.mahalanobis(&scene.rig, Some(&scene.boards));
        assert!(square < chi_square_bound(0.999, dof), "{square} of {dof}");
        assert!((found.variance_factor - 1.0).abs() < 0.05);
    }
}

/// Estimating too few coefficients shows in the residuals, estimating too many in the coefficients'
/// standard deviations.
#[test]
fn a_fixed_choice_is_kept_and_judged() {
    let scene = Scene {
        rig: rig("pmp-real"),
        ..Scene::bench(6, 1)
    };
    let [camera, projector] = scene.sizes();
    let sightings = scene.sightings(Some(1));
    let choice = |set| Choice {
        camera: Coefficients::Fixed(set),
        projector: Coefficients::Auto,
        robust: true,
    };
    let few = solve(
        &scene.board,
        &sightings,
        camera,
        projector,
        &choice([true, false, false, false, false]),
    )
    .unwrap();
    assert_eq!(few.camera_coefficients, [true, false, false, false, false]);
    assert!(few.inflation[0] > 1.5, "{:?}", few.inflation);
    assert!(
        few.warnings
            .iter()
            .any(|w| w.contains("camera points scatter")),
        "{:?}",
        few.warnings
    );
    let many = solve(
        &scene.board,
        &sightings,
        camera,
        projector,
        &choice([true; 5]),
    )
    .unwrap();
    assert!(many.camera_coefficients == [true; 5] && many.inflation == [1.0; 2]);
    // A lens without distortion, fitted with all coefficients: k3 is within one standard deviation
    // of 0 for two of three seeds.
    let plain = Scene::bench(6, 1);
    let told = (0..4).filter(|seed| {
        let sightings = plain.sightings(Some(*seed));
        let found = solve(
            &plain.board,
            &sightings,
            camera,
            projector,
            &choice([true; 5]),
        );
        let warnings = found.unwrap().warnings;
        warnings
            .iter()
            .any(|w| w.contains("cannot be distinguished from 0"))
    });
    assert!(told.count() >= 1);
}
