//! The covariance predicted from the geometry is that which the solver finds.

use super::super::{Choice, Coefficients, solve};
use super::scene::{Scene, rig};
use glam::DMat2;
use phasmid_geometry::Covariance;
use phasmid_geometry::parameters::{PARAMETERS, RIG};

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
