//! Lenses, boards and noise over many orders of magnitude.

use super::super::{Choice, Coefficients, chi_square_bound, solve};
use super::scene::{Scene, poses};
use glam::{DVec2, DVec3};
use phasmid_geometry::{Board, Lens, Pose, Rig, View};

const NONE: Choice = Choice {
    camera: Coefficients::Fixed([false; 5]),
    projector: Coefficients::Fixed([false; 5]),
    robust: true,
};

/// A rig with lenses of the given focal length and field of view (`angle` is the image width over
/// the focal length), and boards of `size_mm`.
fn scene(focal: f64, angle: f64, size_mm: f64, noise: f64) -> Scene {
    let width = focal * angle;
    let lens = Lens {
        width_px: width as u32,
        height_px: (0.75 * width) as u32,
        focal_px: DVec2::splat(focal),
        principal_px: DVec2::new(width, 0.75 * width) * 0.5 - 0.5,
        distortion: [0.0; 5],
    };
    // The board fills half of the image.
    let distance = 2.0 * size_mm / angle;
    let view = |x: f64| View {
        lens,
        rig_from_view: Pose::from_xyz_deg(
            DVec3::new(x, 0.0, 0.0),
            DVec3::new(0.0, -(x / distance).atan().to_degrees(), 0.0),
        ),
    };
    let mut boards = poses(8, distance, 1);
    for pose in &mut boards {
        let place = pose.translation_mm;
        pose.translation_mm = DVec3::new(0.2 * angle * place.x, 0.2 * angle * place.y, place.z);
    }
    Scene {
        board: Board::Chess {
            columns: 9,
            rows: 7,
            pitch_mm: size_mm / 9.0,
        },
        rig: Rig {
            camera: view(0.0),
            projector: view(0.4 * distance),
            noise: None,
            covariance: None,
        },
        boards,
        noise: [noise, noise],
    }
}

#[test]
fn solves_any_scale_of_lens_board_and_noise() {
    for (focal, angle) in [(5.0, 1.5), (600.0, 1.0), (1e5, 0.3)] {
        for size_mm in [1.0, 300.0, 1e5] {
            // Noise from a millionth of a pixel to one pixel, skipping values that are large for a
            // small image.
            for noise in [1e-6, 1e-3, 1.0] {
                if noise > 1e-3 * focal * angle {
                    continue;
                }
                let scene = scene(focal, angle, size_mm, noise);
                let [camera, projector] = scene.sizes();
                let place = format!("focal {focal} px, board {size_mm} mm, noise {noise} px");
                for seed in 0..2 {
                    let sightings = scene.sightings(Some(seed));
                    let found = solve(&scene.board, &sightings, camera, projector, &NONE)
                        .unwrap_or_else(|e| panic!("{place}: {e}"));
                    let (square, dof) = found.mahalanobis(&scene.rig, Some(&scene.boards));
                    assert!(
                        square < chi_square_bound(0.9999, dof),
                        "{place}: {square} of {dof}"
                    );
                    assert!((found.variance_factor - 1.0).abs() < 0.25, "{place}");
                }
            }
        }
    }
}
