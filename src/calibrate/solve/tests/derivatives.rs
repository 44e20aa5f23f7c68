//! Compares analytic derivatives with finite differences.

use super::super::model::{ALL, State, Whitened, linearise, residual};
use super::super::observation::PoseObservations;
use super::scene::{Scene, rig};
use phasmid_geometry::parameters::RIG;

/// The four whitened residuals of a point.
fn numbers(w: &Whitened) -> [f64; 4] {
    let p = w.projector.unwrap();
    [w.camera.x, w.camera.y, p.x, p.y]
}

#[test]
fn derivatives_are_those_of_the_residuals() {
    let scene = Scene {
        rig: rig("pmp-real"),
        ..Scene::bench(2, 5)
    };
    let sightings = scene.sightings(Some(3));
    let observed = PoseObservations::new(&scene.board, &sightings[1], 1);
    let mut state = State {
        camera: scene.rig.camera.lens,
        projector: scene.rig.projector.lens,
        rig_from_projector: scene.rig.projector.rig_from_view,
        boards: scene.boards.clone(),
    };
    // Make every coefficient nonzero.
    state.camera.distortion[4] = 0.03;
    state.projector.distortion = [0.03, -0.02, 3e-3, -2e-3, 0.01];
    let lit = observed.points.iter().filter(|o| o.lit.is_some());
    for o in lit.step_by(29) {
        let (at, slopes) = linearise(o, &state, 1).unwrap();
        let plain = residual(o, &state, 1).unwrap().whitened(o);
        for (a, b) in numbers(&at).iter().zip(numbers(&plain)) {
            assert!((a - b).abs() < 1e-7, "{a} {b}");
        }
        for unknown in 0..ALL {
            // Steps that move the image by about a hundredth of a pixel.
            let step = match unknown {
                i if i >= RIG => [1e-5, 1e-5, 1e-5, 1e-2, 1e-2, 1e-2][i - RIG],
                i if i >= 18 => [1e-5, 1e-5, 1e-5, 1e-2, 1e-2, 1e-2][i - 18],
                i => [1e-2, 1e-2, 1e-2, 1e-2, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4][i % 9],
            };
            let moved = |by: f64| {
                let (mut rig, mut boards) = ([0.0; RIG], [[0.0; 6]; 2]);
                if unknown < RIG {
                    rig[unknown] = by;
                } else {
                    boards[1][unknown - RIG] = by;
                }
                let there = state.stepped(&rig, &boards);
                numbers(&residual(o, &there, 1).unwrap().whitened(o))
            };
            let (up, down) = (moved(step), moved(-step));
            for k in 0..4 {
                let numeric = (down[k] - up[k]) / (2.0 * step);
                let analytic = [
                    slopes.camera[0][unknown],
                    slopes.camera[1][unknown],
                    slopes.projector[0][unknown],
                    slopes.projector[1][unknown],
                ][k];
                let scale = 1.0 / step;
                assert!(
                    (numeric - analytic).abs() < 1e-6 * (scale + analytic.abs()),
                    "unknown {unknown}, number {k}: {numeric} {analytic}"
                );
            }
        }
    }
}
