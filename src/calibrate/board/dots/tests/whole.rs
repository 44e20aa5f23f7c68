//! Boards in various poses, some only partly visible, are found with the correct labels.

use super::render::{Scene, board, pose, small_lens};
use super::{errors, find, of};
use glam::{DVec2, DVec3};

fn scene(at: DVec3, turn: f64, tilt: f64, axis: f64) -> Scene {
    Scene::new(
        board(11, 9),
        small_lens(230, 200),
        pose(at, turn, tilt, axis),
    )
}

const MIDDLE: DVec3 = DVec3::new(0.0, 0.0, 1000.0);

#[test]
fn finds_board_turned_by_any_angle() {
    for k in 0..8 {
        // Wrong labels would cause errors of 15 px.
        let e = errors(&scene(
            MIDDLE,
            7.0 + 45.0 * f64::from(k),
            30.0,
            77.0 * f64::from(k),
        ));
        assert!(e.found == e.there && e.worst < 0.01, "{k}: {}", e.worst);
    }
}

#[test]
fn finds_board_partly_out_of_the_image() {
    for (x, y) in [(90.0, 0.0), (-90.0, 0.0), (0.0, 70.0), (0.0, -70.0)] {
        let mut scene = scene(MIDDLE + DVec3::new(x, y, 0.0), 5.0, 10.0, 0.0);
        scene.lens.principal_px = scene.lens.principal_px.round();
        let e = errors(&scene);
        assert!(
            e.there < 99 && e.found >= e.there - 3,
            "{} {}",
            e.found,
            e.there
        );
        assert!(e.worst < 0.004, "{}", e.worst);
    }
}

#[test]
fn finds_board_with_dots_and_a_marker_hidden() {
    let mut scene = scene(MIDDLE, 33.0, 40.0, 20.0);
    scene.hidden = vec![[7, 4], [0, 0], [1, 5], [2, 5], [10, 8]];
    let e = errors(&scene);
    assert!(e.found == 94 && e.worst < 0.005, "{} {}", e.found, e.worst);
}

#[test]
fn finds_dots_missed_by_the_blob_search() {
    // The shadow is too deep for the blob search but not for the fit.
    let scene = scene(MIDDLE, 0.0, 0.0, 0.0);
    let mut image = scene.image();
    for (k, level) in image.level.iter_mut().enumerate() {
        if k % image.width > 150 {
            *level *= 0.2;
        }
    }
    let seen = find(&scene.board, &image).unwrap();
    let e = of(&scene, &seen);
    assert!(e.found > 85 && e.worst < 0.01, "{} {}", e.found, e.worst);
}

#[test]
fn finds_board_among_clutter() {
    let scene = scene(MIDDLE, 12.0, 20.0, 100.0);
    let mut image = scene.image();
    // Dark rectangles off the board, on a lit background.
    for v in 0..image.height {
        for u in 0..image.width {
            let level = &mut image.level[v * image.width + u];
            if *level < 3.0 {
                *level = if u % 23 < 6 && v % 17 < 5 {
                    20.0
                } else {
                    150.0
                };
            }
        }
    }
    let e = of(&scene, &find(&scene.board, &image).unwrap());
    assert!(
        e.found == e.there && e.worst < 0.005,
        "{} {}",
        e.found,
        e.worst
    );
}

#[test]
fn finds_board_beside_a_stain_as_large_as_a_marker() {
    let scene = scene(MIDDLE, 0.0, 0.0, 0.0);
    let mut image = scene.image();
    // The stain lies where row 4 would continue, six columns left of the middle.
    let stain = scene.lens.principal_px - DVec2::new(6.0 * 24.0 * 0.6322, 0.0);
    for v in 0..image.height {
        for u in 0..25 {
            let away = (DVec2::new(u as f64, v as f64) - stain).length();
            let share = (6.5 - away).clamp(0.0, 1.0);
            image.level[v * image.width + u] = (188.0 * (1.0 - 0.9 * share)) as f32;
        }
    }
    let e = of(&scene, &find(&scene.board, &image).unwrap());
    assert!(e.found == 99 && e.worst < 0.005, "{} {}", e.found, e.worst);
}

#[test]
fn finds_board_near_and_far() {
    // Dot diameters of 3.2 px and 25 px.
    for (z, focal) in [(2000.0, 632.0), (500.0, 1250.0)] {
        let mut scene = Scene::new(
            board(7, 7),
            small_lens(460, 440),
            pose(DVec3::new(0.0, 0.0, z), 15.0, 20.0, 50.0),
        );
        scene.lens.focal_px = DVec2::splat(focal);
        let e = errors(&scene);
        assert!(
            e.found >= e.there && e.worst < 0.006,
            "{} {}",
            e.found,
            e.worst
        );
        assert!((e.chi2 - 1.0).abs() < 0.4, "{}", e.chi2);
    }
}
