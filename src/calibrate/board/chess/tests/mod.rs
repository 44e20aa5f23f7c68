mod scene;

use super::find;
use crate::board::{BoardImage, NotFound, Seen};
use glam::DVec3;
use phasmid_geometry::{Board, Pose};
use scene::{Random, Scene, lens};

const BOARD: Board = Board::Chess {
    columns: 6,
    rows: 5,
    pitch_mm: 25.0,
};

/// A board with squares of about `square` pixels, rotated by angles in degrees about x, y and z.
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

/// RMS error per coordinate, largest error, and RMS of the errors over their standard deviations.
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
    let (rms, worst, _) = errors(scene, &seen);
    assert!(
        rms <= limit && worst <= 5.0 * limit,
        "{what}: rms {rms} worst {worst}"
    );
}

#[test]
fn finds_corners_at_their_true_places() {
    for (square, turn) in [
        (22.0, [0.0, 0.0, 0.0]),
        (24.0, [10.0, -15.0, 7.0]),
        (27.0, [-5.0, 20.0, 45.0]),
        (24.0, [0.0, 0.0, 90.0]),
        (24.0, [20.0, 10.0, 130.0]),
        (30.0, [5.0, 5.0, 180.0]),
        (24.0, [-25.0, 10.0, 260.0]),
    ] {
        // The numbers of columns and rows have an odd sum (6 + 5), so the colours identify every
        // rotation.
        assert_found(&scene(square, turn), 0.012, &format!("{square} {turn:?}"));
    }
    for turn in [[0.0, 0.0, 3.0], [10.0, 20.0, 30.0]] {
        assert_found(&scene(8.0, turn), 0.03, &format!("8 {turn:?}"));
    }
}

#[test]
fn finds_corners_under_blur_uneven_light_tilt_and_distortion() {
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
fn errors_match_stated_covariance() {
    // A single frame in poor light, so that noise dominates over errors of the model.
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
        let (_, _, whitened) = errors(&poor, &seen);
        sum += whitened * whitened;
        n += 1.0;
    }
    let ratio = f64::sqrt(sum / n);
    assert!((0.85..1.3).contains(&ratio), "{ratio}");
}

#[test]
fn errors_of_sharp_corners_match_stated_covariance() {
    let (mut sum, mut n) = (0.0, 0.0);
    for (seed, turn) in [
        [3.0, 2.0, 1.0],
        [-20.0, 15.0, 0.0],
        [10.0, 30.0, 33.0],
        [0.0, 0.0, 0.5],
    ]
    .into_iter()
    .enumerate()
    {
        let sharp = Scene {
            blur: 0.0,
            light: |_| 60.0,
            seed: seed as u64,
            ..scene(20.0, turn)
        };
        let seen = find(&sharp.board, &sharp.render()).unwrap();
        let (_, _, whitened) = errors(&sharp, &seen);
        sum += whitened * whitened;
        n += 1.0;
    }
    let ratio = f64::sqrt(sum / n);
    assert!((0.85..1.15).contains(&ratio), "{ratio}");
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

/// The error that a search returns.
fn refusal(board: &Board, image: &BoardImage) -> NotFound {
    match find(board, image) {
        Ok(seen) => panic!("{} corners", seen.len()),
        Err(error) => error,
    }
}

fn chess(columns: u32, rows: u32) -> Board {
    Board::Chess {
        columns,
        rows,
        pitch_mm: 25.0,
    }
}

#[test]
fn another_board_or_part_of_one_is_refused_with_numbers() {
    let whole = scene(22.0, [12.0, 8.0, 5.0]);
    let image = whole.render();
    for (board, needles) in [
        (
            chess(5, 4),
            ["another board", "30 corners in a grid of 6 x 5", "5 x 4"],
        ),
        (
            chess(6, 4),
            ["another board", "30 corners in a grid of 6 x 5", "6 x 4"],
        ),
        (
            chess(7, 5),
            ["part of a board", "30 corners in a grid of 6 x 5", "7 x 5"],
        ),
        (chess(6, 2), ["is ambiguous", "6 x 2", "3 x 3"]),
        (chess(0, 9), ["is ambiguous", "0 x 9", "3 x 3"]),
    ] {
        let message = refusal(&board, &image).to_string();
        for needle in needles {
            assert!(message.contains(needle), "{needle} not in: {message}");
        }
    }
    // Two cases: half of the board lies outside the image; four of the 30 corners are occluded.
    let half = Scene {
        camera_from_board: Pose::from_xyz_deg(DVec3::new(130.0, 0.0, 700.0), DVec3::ZERO),
        ..scene(22.0, [0.0; 3])
    };
    assert!(matches!(
        refusal(&BOARD, &half.render()),
        NotFound::Partial { .. }
    ));
    let corners = [[2, 2], [4, 1], [0, 0], [3, 4]];
    let mut hidden = hide(&whole, &image, &corners);
    assert!(matches!(refusal(&BOARD, &hidden), NotFound::Partial { .. }));
    // Occlude the corners by saturated pixels instead of grey ones.
    for level in hidden.level.iter_mut().filter(|v| **v == 20.0) {
        *level = f32::NAN;
    }
    refusal(&BOARD, &hidden);
}

/// Covers corners with grey squares.
fn hide(scene: &Scene, image: &BoardImage, corners: &[[u32; 2]]) -> BoardImage {
    let mut hidden = image.clone();
    for &index in corners {
        let corner = scene.truth(index).round();
        for (y, x) in (0..14).flat_map(|y| (0..14).map(move |x| (y, x))) {
            let at = (corner.y as usize + y - 7) * hidden.width + corner.x as usize + x - 7;
            hidden.level[at] = 20.0;
        }
    }
    hidden
}

#[test]
fn a_corner_that_cannot_be_measured_is_left_out() {
    let whole = scene(22.0, [12.0, 8.0, 5.0]);
    let seen = find(&BOARD, &hide(&whole, &whole.render(), &[[2, 2]])).unwrap();
    let others = BOARD.indices().filter(|&index| index != [2, 2]);
    assert!(seen.iter().map(|s| s.index).eq(others));
    let (rms, worst, _) = errors(&whole, &seen);
    assert!(rms <= 0.012 && worst <= 0.06, "rms {rms} worst {worst}");
}

#[test]
fn sharp_edges_along_the_pixels_rows_are_measured() {
    // Boards that face the camera without blur, some aligned exactly with the pixels.
    for (x, y, tilt) in [
        (0.0, 0.0, 0.0),
        (0.3, 0.1, 0.0),
        (0.5, 0.5, 0.0),
        (0.2, 0.7, 1.0),
    ] {
        let square = 22.0;
        let sharp = Scene {
            blur: 0.0,
            camera_from_board: Pose::from_xyz_deg(
                DVec3::new(3.3 + x, -2.1 + y, 0.0) * (25.0 / square)
                    + DVec3::Z * (630.0 * 25.0 / square),
                DVec3::new(tilt, -tilt, 0.0),
            ),
            ..scene(square, [0.0; 3])
        };
        assert_found(&sharp, 0.006, &format!("{x} {y} {tilt}"));
    }
}

#[test]
fn images_without_a_board_are_refused() {
    let mut random = Random(99);
    let mut noise = |width: usize, height: usize, size: f64| {
        let level = (0..width * height).map(|_| (100.0 + size * random.normal()) as f32);
        BoardImage {
            width,
            height,
            level: level.collect(),
            variance: vec![(size * size) as f32; width * height],
        }
    };
    for size in [0.0, 1.0, 40.0] {
        let image = noise(320, 240, size);
        assert!(
            matches!(refusal(&BOARD, &image), NotFound::Nothing { .. }),
            "{size}"
        );
    }
    // An image with noise far above its stated variance shows no board.
    let mut unknown = noise(320, 240, 30.0);
    unknown.variance.fill(1e-6);
    refusal(&BOARD, &unknown);
    for (width, height) in [(0, 0), (1, 1), (3, 200), (9, 9), (17, 33)] {
        refusal(&BOARD, &noise(width, height, 10.0));
    }
    let mut odd = noise(64, 64, 10.0);
    odd.level.fill(f32::NAN);
    refusal(&BOARD, &odd);
    odd.level.fill(f32::INFINITY);
    odd.variance.fill(f32::NAN);
    refusal(&BOARD, &odd);
    odd.level.truncate(7);
    refusal(&BOARD, &odd);
    // Dots with a pitch of 5 to 20 pixels.
    for pitch in [5.0, 7.0, 10.0, 20.0] {
        let mut dots = noise(300, 240, 0.5);
        for (i, level) in dots.level.iter_mut().enumerate() {
            let [x, y] = [i % 300, i / 300].map(|v| (v as f64 / pitch).fract() - 0.5);
            *level +=
                (120.0 * (1.0 - ((x.hypot(y) - 0.25) * 6.0).clamp(-1.0, 1.0)) - 60.0).abs() as f32;
        }
        refusal(&BOARD, &dots);
    }
    assert!(matches!(
        refusal(&Board::DOTS, &odd),
        NotFound::Nothing { .. }
    ));
}

#[test]
fn ambiguous_rotation_starts_at_uppermost_corner() {
    // Boards whose numbers of columns and rows have an even sum; on some, both numbers are equal.
    for (board, turns) in [
        (chess(6, 4), [0.0, 20.0, 180.0, 200.0]),
        (chess(5, 5), [0.0, 90.0, 180.0, 265.0]),
    ] {
        for turn in turns {
            let scene = Scene {
                board,
                ..scene(24.0, [10.0, 10.0, turn])
            };
            let seen = find(&board, &scene.render()).unwrap();
            let px = |i: usize| seen[i].px;
            assert!(px(0).y < px(seen.len() - 1).y);
            // Each found point is a corner of the board, and y is clockwise of x.
            for s in &seen {
                let near = board.indices().map(|i| scene.truth(i).distance(s.px));
                assert!(near.min_by(f64::total_cmp).is_some_and(|d| d < 0.02));
            }
            let [columns, _] = board.grid();
            let down = px(columns as usize) - px(0);
            assert!((px(1) - px(0)).perp_dot(down) > 0.0);
        }
    }
}

#[test]
fn refuses_image_of_two_boards() {
    let one = scene(16.0, [5.0, 3.0, 10.0]).render();
    let mut two = one.clone();
    two.width *= 2;
    let rows = |v: &[f32]| {
        v.chunks(one.width)
            .flat_map(|row| [row, row].concat())
            .collect()
    };
    (two.level, two.variance) = (rows(&one.level), rows(&one.variance));
    let message = refusal(&BOARD, &two).to_string();
    assert!(message.contains("2 boards of 6 x 5 corners"), "{message}");
}

#[test]
fn large_squares_out_of_focus_are_found_at_half_the_size() {
    let soft = Scene {
        lens: lens(720, 600, [0.0; 5]),
        blur: 7.0,
        frames: 1,
        light: |_| 60.0,
        ..scene(70.0, [20.0, 10.0, 15.0])
    };
    assert_found(&soft, 0.1, "out of focus");
}
