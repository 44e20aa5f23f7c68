mod scene;

use super::find;
use crate::calibrate::board::{NotFound, Picture, Seen};
use crate::geometry::{Board, Pose};
use glam::DVec3;
use scene::{Random, Scene, lens};

const BOARD: Board = Board::Chess {
    columns: 6,
    rows: 5,
    pitch_mm: 25.0,
};

/// A board with squares of about `square` pixels, turned by degrees about x, y and z.
fn scene(square: f64, turn_deg: [f64; 3]) -> Scene {
    let place = DVec3::new(4.0, -3.0, 630.0 * 25.0 / square);
    Scene {
        board: BOARD,
        lens: lens(256, 240, [0.0; 5]),
        camera_from_board: Pose::from_xyz_deg(place, turn_deg.into()),
        blur: 0.5,
        light: |_| 110.0,
        frames: 12,
        seed: 7,
    }
}

/// Root mean square and largest error, and the root mean square of errors by their standard
/// deviations.
fn errors(scene: &Scene, seen: &[Seen]) -> (f64, f64, f64) {
    let (mut squares, mut worst, mut whitened) = (0.0, 0.0_f64, 0.0);
    for s in seen {
        let off = s.px - scene.truth(s.index);
        squares += off.length_squared();
        worst = worst.max(off.length());
        whitened += off.dot(s.covariance.inverse() * off);
    }
    let n = 2.0 * seen.len() as f64;
    ((squares / n).sqrt(), worst, (whitened / n).sqrt())
}

fn assert_found(scene: &Scene, limit: f64, what: &str) {
    let seen = match find(&scene.board, &scene.render()) {
        Ok(seen) => seen,
        Err(error) => panic!("{what}: {error}"),
    };
    assert!(seen.iter().map(|s| s.index).eq(scene.board.indices()));
    let (rms, worst, whitened) = errors(scene, &seen);
    println!("{what}: rms {rms:.4} worst {worst:.4} whitened {whitened:.2}");
    assert!(
        rms <= limit && worst <= 5.0 * limit,
        "{what}: rms {rms} worst {worst}"
    );
}

#[test]
fn corners_are_where_they_are() {
    for (square, turn) in [
        (22.0, [0.0, 0.0, 0.0]),
        (24.0, [10.0, -15.0, 7.0]),
        (27.0, [-5.0, 20.0, 45.0]),
        (24.0, [0.0, 0.0, 90.0]),
        (24.0, [20.0, 10.0, 130.0]),
        (30.0, [5.0, 5.0, 180.0]),
        (24.0, [-25.0, 10.0, 260.0]),
    ] {
        // 6 x 5 is an odd number together: the colours decide, so every turn is told.
        assert_found(&scene(square, turn), 0.012, &format!("{square} {turn:?}"));
    }
    for turn in [[0.0, 0.0, 3.0], [10.0, 20.0, 30.0]] {
        assert_found(&scene(8.0, turn), 0.03, &format!("8 {turn:?}"));
    }
}

#[test]
fn blur_light_tilt_and_distortion_do_no_harm() {
    for blur in [0.0, 0.3, 1.0, 2.0] {
        let sharp = Scene {
            blur,
            ..scene(22.0, [12.0, -10.0, 4.0])
        };
        assert_found(&sharp, 0.012, &format!("blur {blur}"));
        let small = Scene {
            blur,
            ..scene(8.5, [5.0, -10.0, 14.0])
        };
        assert_found(&small, 0.03, &format!("small, blur {blur}"));
    }
    let uneven = Scene {
        light: |p| 25.0 + 125.0 * p.x / 256.0,
        ..scene(24.0, [0.0, 20.0, 0.0])
    };
    assert_found(&uneven, 0.012, "uneven light");
    for turn in [
        [60.0, 0.0, 0.0],
        [0.0, 60.0, 10.0],
        [60.0, 0.0, 45.0],
        [-42.0, 42.0, 20.0],
    ] {
        assert_found(&scene(24.0, turn), 0.012, &format!("tilt {turn:?}"));
    }
    let wide = lens(256, 240, [-0.25, 0.1, 1e-3, -1e-3, 0.0]);
    for turn in [[0.0, 0.0, 0.0], [30.0, 20.0, 70.0]] {
        assert_found(
            &Scene {
                lens: wide,
                ..scene(30.0, turn)
            },
            0.012,
            "distortion",
        );
    }
}

#[test]
fn errors_are_those_of_the_noise() {
    // One frame in poor light, so that noise counts for more than the model.
    let (mut sum, mut n) = (0.0, 0.0);
    for seed in 0..6 {
        let poor = Scene {
            frames: 1,
            light: |_| 25.0,
            seed,
            blur: 0.8,
            ..scene(22.0, [10.0, 20.0, 33.0])
        };
        let seen = find(&poor.board, &poor.render()).unwrap();
        let (rms, _, whitened) = errors(&poor, &seen);
        println!("poor light: rms {rms:.4} whitened {whitened:.3}");
        sum += whitened * whitened;
        n += 1.0;
    }
    let ratio = f64::sqrt(sum / n);
    assert!((0.85..1.3).contains(&ratio), "{ratio}");
}

#[test]
fn squares_without_noise_are_exact() {
    let clean = Scene {
        frames: 0,
        blur: 0.7,
        ..scene(26.0, [8.0, 12.0, 5.0])
    };
    assert_found(&clean, 0.002, "no noise");
}

#[test]
fn zz_diag() {
    for seed in 0..6 {
        let uneven = Scene {
            seed,
            light: |p| 25.0 + 125.0 * p.x / 256.0,
            ..scene(24.0, [0.0, 20.0, 0.0])
        };
        assert_found(&uneven, 0.012, "uneven light");
    }
    let uneven = Scene {
        frames: 0,
        light: |p| 25.0 + 125.0 * p.x / 256.0,
        ..scene(24.0, [0.0, 20.0, 0.0])
    };
    assert_found(&uneven, 0.012, "uneven light");
    let t = std::time::Instant::now();
    let p = uneven.render();
    println!("render {:?}", t.elapsed());
    let big = Scene {
        board: Board::CHESS,
        lens: lens(1138, 489, [0.0; 5]),
        ..scene(45.0, [10.0, 5.0, 3.0])
    };
    let p = big.render();
    for _ in 0..5 {
        let t = std::time::Instant::now();
        let seen = find(&big.board, &p);
        println!("find {:?} {}", t.elapsed(), seen.is_ok());
    }
    let t = std::time::Instant::now();
    let mut g = super::Grey::of(&p);
    println!("grey {:?}", t.elapsed());
    let s = g.smoothed();
    println!("smooth {:?}", t.elapsed());
    let s2 = super::saddles::saddles(&s);
    println!("saddles {:?} {}", t.elapsed(), s2.len());
    let l = super::links::links(&s, &s2);
    println!("links {:?}", t.elapsed());
}
