//! Locating a board with a known rig.

use super::super::{Placed, chi_square_below, place};
use super::scene::{Scene, rig};
use nalgebra::{Matrix6, Vector6};
use phasmid_geometry::rotation::difference;
use phasmid_geometry::{Pose, Rig};

fn placed(scene: &Scene, rig: &Rig, seed: Option<u64>) -> Vec<Placed> {
    let all = scene.sightings(seed);
    let one = |sightings| place(&scene.board, sightings, rig).unwrap();
    all.iter().map(one).collect()
}

/// Squared Mahalanobis distance from the truth, with six degrees of freedom.
fn square(placed: &Placed, truth: &Pose) -> f64 {
    let off = Vector6::from(difference(truth, &placed.rig_from_board));
    let covariance = Matrix6::from_fn(|i, j| placed.covariance[i][j]);
    off.dot(&(covariance.try_inverse().unwrap() * off))
}

#[test]
fn exact_sightings_give_the_exact_place_through_any_lens() {
    for profile in ["pmp-bench", "pmp-real"] {
        let scene = Scene {
            rig: rig(profile),
            ..Scene::bench(8, 1)
        };
        for (found, truth) in placed(&scene, &scene.rig, None).iter().zip(&scene.boards) {
            let off = difference(truth, &found.rig_from_board);
            assert!(off.iter().all(|o| o.abs() < 1e-7), "{off:?}");
            assert!(found.pose.camera_errors.max_px < 1e-7);
            assert!(found.pose.projector_errors.max_px < 1e-7);
        }
    }
}

#[test]
fn errors_are_as_large_as_the_covariance_says() {
    let scene = Scene::bench(4, 3);
    let mut all = Vec::new();
    for seed in 0..50 {
        let found = placed(&scene, &scene.rig, Some(seed));
        let squares = found.iter().zip(&scene.boards);
        all.extend(squares.map(|(found, truth)| chi_square_below(square(found, truth), 6)));
    }
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    // The mean of 200 uniform numbers in [0, 1] is 0.5 with a standard deviation of 0.02.
    assert!((mean - 0.5).abs() < 0.065, "{mean}");
    let beyond = all.iter().filter(|p| **p > 0.99).count();
    assert!(beyond <= 8, "{beyond} of 200 beyond the 99 % bound");
}

#[test]
fn outliers_are_left_out_and_a_wrong_rig_raises_residuals() {
    let scene = Scene::bench(1, 5);
    let mut sightings = scene.sightings(Some(1));
    for sighting in sightings[0].sightings.iter_mut().step_by(20) {
        sighting.camera_px.x += 3.0;
    }
    let found = place(&scene.board, &sightings[0], &scene.rig).unwrap();
    let all = sightings[0].sightings.len();
    assert!(found.pose.camera_errors.count <= all - all / 20);
    assert!(square(&found, &scene.boards[0]) < 30.0);

    // The baseline of this rig is 0.1 % longer than the true one.
    let mut grown = scene.rig;
    grown.projector.rig_from_view.translation_mm *= 1.001;
    let honest = place(&scene.board, &scene.sightings(Some(1))[0], &scene.rig).unwrap();
    let wrong = place(&scene.board, &scene.sightings(Some(1))[0], &grown).unwrap();
    let whitened = |p: &Placed| p.pose.projector_errors.whitened_rms;
    assert!(whitened(&honest) < 1.1, "{}", whitened(&honest));
    assert!(whitened(&wrong) > 1.5, "{}", whitened(&wrong));
}

#[test]
fn refuses_sightings_that_determine_no_place() {
    let scene = Scene::bench(1, 5);
    let whole = scene.sightings(None).remove(0);
    let refused = |change: &dyn Fn(&mut super::super::PoseSightings)| {
        let mut sightings = whole.clone();
        change(&mut sightings);
        place(&scene.board, &sightings, &scene.rig)
            .unwrap_err()
            .to_string()
    };
    assert!(refused(&|s| s.sightings.truncate(5)).contains("5 points"));
    let line = refused(&|s| s.sightings.retain(|p| p.index[1] == 3));
    assert!(line.contains("points on a line"), "{line}");
    let mirrored = refused(&|s| {
        for p in &mut s.sightings {
            p.camera_px.x = 1137.0 - p.camera_px.x;
        }
    });
    assert!(mirrored.contains("mirrored"), "{mirrored}");
}
