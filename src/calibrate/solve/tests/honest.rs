//! Tests that the covariance is right: over many seeds, errors are as large as the covariance
//! predicts, and the covariance agrees with the prediction from the geometry alone.

use super::super::{Choice, Coefficients, Solution, chi_square_below, chi_square_bound, solve};
use super::scene::{Scene, rig};
use glam::DMat2;
use phasmid_geometry::parameters::{PARAMETERS, RIG};
use phasmid_geometry::{Board, Covariance};

const NONE: Choice = Choice {
    camera: Coefficients::Fixed([false; 5]),
    projector: Coefficients::Fixed([false; 5]),
    robust: true,
};

fn solved(scene: &Scene, seed: u64, choice: &Choice) -> Solution {
    let [camera, projector] = scene.sizes();
    solve(
        &scene.board,
        &scene.sightings(Some(seed)),
        camera,
        projector,
        choice,
    )
    .unwrap()
}

/// Kolmogorov-Smirnov distance between the given probabilities and the uniform distribution, times
/// the square root of the number of probabilities. If they are uniform, it exceeds 1.95 in one of a
/// thousand cases (Smirnov 1948).
fn uneven(mut probabilities: Vec<f64>) -> f64 {
    probabilities.sort_by(f64::total_cmp);
    let n = probabilities.len() as f64;
    let gap = |(i, p): (usize, &f64)| (p - i as f64 / n).abs().max((p - (i + 1) as f64 / n).abs());
    let largest = probabilities
        .iter()
        .enumerate()
        .map(gap)
        .fold(0.0, f64::max);
    largest * n.sqrt()
}

fn check(scene: &Scene, seeds: u64, choice: &Choice) {
    let (mut of_all, mut of_rig, mut of_fit) = (Vec::new(), Vec::new(), Vec::new());
    let (mut squares, mut unknowns) = (0.0, 0);
    for seed in 0..seeds {
        let found = solved(scene, seed, choice);
        assert!(found.left_out.is_empty(), "{:?}", found.left_out);
        let (square, dof) = found.mahalanobis(&scene.rig, Some(&scene.boards));
        squares += square;
        unknowns += dof;
        of_all.push(chi_square_below(square, dof));
        let (square, dof) = found.mahalanobis(&scene.rig, None);
        of_rig.push(chi_square_below(square, dof));
        let sum = found.variance_factor * found.degrees_of_freedom as f64;
        of_fit.push(chi_square_below(sum, found.degrees_of_freedom));
    }
    // The sum over the seeds also follows a chi-square distribution.
    assert!(
        squares < chi_square_bound(0.999, unknowns),
        "{squares} of {unknowns}"
    );
    assert!(
        squares > chi_square_bound(0.001, unknowns),
        "{squares} of {unknowns}"
    );
    for (what, probabilities) in [("all", of_all), ("the rig", of_rig), ("the fit", of_fit)] {
        let uneven = uneven(probabilities);
        assert!(uneven < 1.95, "{what}: {uneven}");
    }
}

#[test]
fn squared_distances_follow_the_chi_square_distribution() {
    let scene = Scene {
        board: Board::CHESS.scaled(3.0),
        ..Scene::bench(6, 2)
    };
    check(&scene, 200, &NONE);
}

#[test]
#[ignore = "50 rigs of 20 poses with 475 points take 10 s"]
fn squared_distances_at_full_size_follow_chi_square() {
    check(&Scene::bench(20, 1), 50, &Choice::default());
}

/// Understated covariances are detected, and the estimated errors are right nevertheless.
#[test]
fn understated_noise_is_estimated() {
    let scene = Scene {
        board: Board::CHESS.scaled(3.0),
        ..Scene::bench(8, 3)
    };
    let [camera, projector] = scene.sizes();
    let (mut squares, mut unknowns) = (0.0, 0);
    for seed in 0..40 {
        let mut sightings = scene.sightings(Some(seed));
        for s in sightings.iter_mut().flat_map(|p| &mut p.sightings) {
            s.camera_covariance *= 1.0 / 9.0;
            if let Some(lit) = &mut s.projector {
                lit.covariance *= 1.0 / 4.0;
            }
        }
        let found = solve(&scene.board, &sightings, camera, projector, &NONE).unwrap();
        let [camera, projector] = found.inflation;
        assert!((camera / 9.0 - 1.0).abs() < 0.25 && (projector / 4.0 - 1.0).abs() < 0.25);
        assert!(found.variance_factor > 4.0 && found.variance_factor < 9.0);
        let noted = |what: &str| found.warnings.iter().any(|w| w.contains(what));
        assert!(noted("camera points scatter 3.") || noted("camera points scatter 2."));
        let (square, dof) = found.mahalanobis(&scene.rig, Some(&scene.boards));
        squares += square;
        unknowns += dof;
    }
    // The estimated inflation factors are themselves uncertain by a few per cent.
    let ratio = squares / unknowns as f64;
    assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
}

#[test]
fn predicted_covariance_is_that_of_the_solution() {
    let corner_px = 0.05;
    for (device, coefficients) in [("pmp-bench", [false; 5]), ("pmp-real", [true; 5])] {
        let scene = Scene {
            rig: rig(device),
            ..Scene::bench(8, 3)
        };
        let mut poses = scene.sightings(None);
        for sighting in poses.iter_mut().flat_map(|pose| &mut pose.sightings) {
            let covariance = DMat2::IDENTITY * (corner_px * corner_px);
            sighting.camera_covariance = covariance;
            if let Some(lit) = &mut sighting.projector {
                lit.covariance = covariance;
            }
        }
        let fixed = Coefficients::Fixed(coefficients);
        let choice = Choice {
            camera: fixed,
            projector: fixed,
            robust: false,
        };
        let [camera, projector] = scene.sizes();
        let found = solve(&scene.board, &poses, camera, projector, &choice).unwrap();
        let found = found.rig.covariance.unwrap();
        let predicted = Covariance::of_calibration(
            &scene.rig,
            &scene.board,
            &scene.boards,
            corner_px,
            found.estimated(),
        )
        .unwrap();
        for i in (0..RIG).filter(|i| found.estimated()[*i]) {
            for j in 0..=i {
                let scale = (predicted.of(i, i) * predicted.of(j, j)).sqrt();
                let off = (found.of(i, j) - predicted.of(i, j)).abs();
                let names = [PARAMETERS[i].0, PARAMETERS[j].0];
                assert!(off <= 1e-4 * scale, "{device} {names:?}: {off} of {scale}");
            }
        }
    }
}
