//! Exact data reproduce the rig.

use super::super::{Choice, Coefficients, Solution, solve};
use super::scene::{Scene, rig};

const NONE: Choice = Choice {
    camera: Coefficients::Fixed([false; 5]),
    projector: Coefficients::Fixed([false; 5]),
    robust: true,
};
const ALL_FIVE: Choice = Choice {
    camera: Coefficients::Fixed([true; 5]),
    projector: Coefficients::Fixed([true; 5]),
    robust: true,
};

/// Largest error of a parameter of the rig, relative to its size (absolute for angles and
/// coefficients).
fn worst(found: &Solution, scene: &Scene) -> f64 {
    let mut worst = 0.0f64;
    for (a, b) in [
        (&found.rig.camera, &scene.rig.camera),
        (&found.rig.projector, &scene.rig.projector),
    ] {
        let f = b.lens.focal_px.x;
        worst = worst.max((a.lens.focal_px - b.lens.focal_px).length() / f);
        worst = worst.max((a.lens.principal_px - b.lens.principal_px).length() / f);
        for (k, l) in a.lens.distortion.iter().zip(b.lens.distortion) {
            worst = worst.max((k - l).abs());
        }
        let turned = a.rig_from_view.rotation - b.rig_from_view.rotation;
        worst = worst.max(turned.x_axis.length() + turned.y_axis.length());
        worst = worst.max((a.center() - b.center()).length() / 400.0);
    }
    worst
}

#[test]
fn exact_sightings_give_the_exact_rig() {
    for (profile, choice) in [
        ("pmp-bench", NONE),
        (
            "pmp-bench",
            Choice {
                robust: false,
                ..NONE
            },
        ),
        ("pmp-real", ALL_FIVE),
        ("pmp-real", Choice::default()),
    ] {
        let scene = Scene {
            rig: rig(profile),
            ..Scene::bench(8, 1)
        };
        let [camera, projector] = scene.sizes();
        let found = solve(
            &scene.board,
            &scene.sightings(None),
            camera,
            projector,
            &choice,
        )
        .unwrap();
        // The r^6 coefficients are the least well determined.
        let error = worst(&found, &scene);
        assert!(error < 1e-9, "{profile} {choice:?}: {error:e}");
        for (pose, truth) in found.poses.iter().zip(&scene.boards) {
            let off = (pose.camera_from_board.translation_mm - truth.translation_mm).length();
            assert!(off < 1e-6, "{off:e}");
        }
        assert!(found.camera_errors.max_px < 1e-8 && found.projector_errors.max_px < 1e-8);
        assert!(found.variance_factor < 1e-6 && found.inflation == [1.0; 2]);
        assert!(found.left_out.is_empty());
        assert!(found.mahalanobis(&scene.rig, Some(&scene.boards)).0 < 1e-6);
    }
}
