//! Compares centroids with ground truth, and the covariance of the centroids with their actual
//! errors and with the Cramer-Rao bound.

use super::render::{Scene, bench_lens, board, pose, small_lens};
use super::{errors, find, of};
use glam::{DVec2, DVec3};
use phasmid_geometry::Board;

/// An 11 x 9 board 1000 mm away, as on the bench, in an image that just contains it.
fn small(turn: f64, tilt: f64, axis: f64) -> Scene {
    let at = DVec3::new(0.0, 0.0, 1000.0);
    Scene::new(
        board(11, 9),
        small_lens(230, 200),
        pose(at, turn, tilt, axis),
    )
}

#[test]
fn finds_bench_board_with_errors_at_noise_bound() {
    let at = DVec3::new(10.0, -5.0, 1000.0);
    let scene = Scene::new(
        Board::DOTS.scaled(4.0),
        bench_lens(),
        pose(at, 10.0, 20.0, 30.0),
    );
    let e = errors(&scene);
    assert_eq!(e.found, e.there);
    assert!(e.rms < 0.0004 && e.worst < 0.002, "{} {}", e.rms, e.worst);
    // 475 dots (950 coordinates) determine the mean squared error to 5 %.
    assert!((e.chi2 - 1.0).abs() < 0.2, "{}", e.chi2);
    assert!(e.mean.length() < 1e-4);
}

#[test]
fn is_accurate_at_60_degrees_in_any_direction() {
    for axis in [0.0, 45.0, 90.0, 135.0] {
        let mut scene = small(axis * 1.7, 60.0, axis);
        scene.seed = axis as u64;
        let e = errors(&scene);
        assert!(e.found == e.there, "{} {}", e.found, e.there);
        assert!(e.rms < 0.001 && e.worst < 0.004, "{} {}", e.rms, e.worst);
        assert!((e.chi2 - 1.0).abs() < 0.4, "{}", e.chi2);
    }
}

#[test]
fn is_accurate_under_blur() {
    for (blur, tilt) in [(0.3, 20.0), (0.7, 20.0), (1.5, 20.0), (0.6, 58.0)] {
        let mut scene = small(10.0, tilt, 30.0);
        scene.blur = blur;
        let e = errors(&scene);
        assert_eq!(e.found, e.there);
        assert!(e.rms < 0.0013 && e.worst < 0.006, "{} {}", e.rms, e.worst);
        assert!((e.chi2 - 1.0).abs() < 0.4, "{}", e.chi2);
    }
}

#[test]
fn is_accurate_in_focus_on_one_side_only() {
    let of = |blur: f64| {
        let mut scene = small(0.0, 0.0, 0.0);
        scene.blur = blur;
        scene
    };
    let (near, far) = (of(0.5), of(0.9));
    let mut image = near.image();
    let other = far.image();
    for (k, level) in image.level.iter_mut().enumerate() {
        // The split lies between columns 5 and 6 of the board.
        if k % image.width > 121 {
            *level = other.level[k];
        }
    }
    let e = super::of(&far, &find(&far.board, &image).unwrap());
    assert_eq!(e.found, e.there);
    assert!(e.rms < 0.0012 && e.worst < 0.006, "{} {}", e.rms, e.worst);
}

#[test]
fn is_accurate_under_light_that_falls_to_a_fifth() {
    for blur in [0.0, 1.0] {
        let mut scene = small(100.0, 25.0, 70.0);
        scene.light = |px| 188.0 * (-px.dot(DVec2::new(0.8, 0.6)) / 220.0 * 5f64.ln()).exp();
        scene.blur = blur;
        let e = errors(&scene);
        assert_eq!(e.found, e.there);
        assert!(e.rms < 0.0025 && e.worst < 0.012, "{} {}", e.rms, e.worst);
        assert!(e.mean.length() < 4e-4, "{}", e.mean);
        assert!((e.chi2 - 1.0).abs() < 0.5, "{}", e.chi2);
    }
}

#[test]
fn is_accurate_under_four_times_the_noise() {
    let mut scene = small(-60.0, 35.0, 10.0);
    scene.noise = 4.0;
    let e = errors(&scene);
    assert_eq!(e.found, e.there);
    assert!(e.rms < 0.002 && (e.chi2 - 1.0).abs() < 0.4);
}

#[test]
fn is_accurate_through_a_distorting_lens() {
    let mut scene = Scene::new(
        board(15, 13),
        small_lens(300, 270),
        pose(DVec3::new(0.0, 0.0, 1000.0), 30.0, 30.0, 80.0),
    );
    // Distortion reaches 4 % in the corners.
    scene.lens.focal_px = DVec2::splat(500.0);
    scene.lens.distortion = [-0.35, 0.1, 2e-3, -1e-3, 0.0];
    let e = errors(&scene);
    assert_eq!(e.found, e.there);
    assert!(e.rms < 0.0008, "{}", e.rms);
}

#[test]
fn has_no_error_that_varies_within_a_pixel() {
    for blur in [0.0, 0.5] {
        for step in 0..5 {
            let px = f64::from(step) / 5.0;
            let mut scene = small(0.0, 0.0, 0.0);
            // One pixel is 1.58 mm; x and y move by different fractions of a pixel.
            scene.pose.translation_mm += DVec3::new(px, px * 0.37, 0.0) * 1000.0 / 632.2;
            (scene.noise, scene.blur) = (0.0, blur);
            let e = errors(&scene);
            assert!(e.found == e.there && e.worst < 5e-4, "{px}: {}", e.worst);
        }
    }
}

#[test]
fn covariance_is_near_cramer_rao_bound() {
    let scene = small(0.0, 0.0, 0.0);
    let seen = find(&scene.board, &scene.image()).unwrap();
    // Derivative of the image with respect to a shift of the board along x.
    let moved = |px: f64| {
        let mut scene = small(0.0, 0.0, 0.0);
        scene.pose.translation_mm.x += px * 1000.0 / 632.2;
        scene.noise = 0.0;
        scene.image()
    };
    let (minus, plus) = (moved(-0.05), moved(0.05));
    let variance = scene.image().variance;
    for s in &seen {
        let mut information = 0.0;
        for (k, v) in variance.iter().enumerate() {
            let (x, y) = (k % minus.width, k / minus.width);
            // Half a pitch is 7.6 px.
            let away = (DVec2::new(x as f64, y as f64) - s.px).abs();
            if away.max_element() < 7.5 {
                let slope = f64::from(plus.level[k] - minus.level[k]) / 0.1;
                information += slope * slope / f64::from(*v);
            }
        }
        // The fit also estimates the light's gradient and the outline, which the bound assumes to
        // be known.
        let ratio = (s.covariance.x_axis.x * information).sqrt();
        assert!((0.97..1.2).contains(&ratio), "{:?}: {ratio}", s.index);
    }
}

#[test]
fn is_accurate_despite_specks_and_dead_pixels() {
    let scene = small(20.0, 30.0, 0.0);
    let mut image = scene.image();
    for (k, level) in image.level.iter_mut().enumerate() {
        match k % 211 {
            7 => *level = f32::NAN,
            100 => *level += 40.0,
            _ => {}
        }
    }
    let seen = find(&scene.board, &image).unwrap();
    let e = of(&scene, &seen);
    // Some dots are rejected because one of their edge pixels is unusable.
    assert!(e.found * 10 > e.there * 8, "{} {}", e.found, e.there);
    assert!(e.rms < 0.0006 && e.worst < 0.003, "{} {}", e.rms, e.worst);
}
