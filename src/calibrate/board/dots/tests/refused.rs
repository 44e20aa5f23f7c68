//! Images without the specified board are rejected, with the reason.

use super::find;
use super::render::{Draw, Scene, board, pose, small_lens};
use crate::board::{BoardImage, NotFound};
use glam::DVec3;
use phasmid_geometry::Board;

fn scene() -> Scene {
    let at = DVec3::new(0.0, 0.0, 1000.0);
    Scene::new(
        board(11, 9),
        small_lens(230, 200),
        pose(at, 20.0, 30.0, 40.0),
    )
}

fn image(level: impl Fn(usize, usize) -> f64) -> BoardImage {
    let (width, height) = (230, 200);
    BoardImage {
        width,
        height,
        level: (0..width * height)
            .map(|k| level(k % width, k / width) as f32)
            .collect(),
        variance: vec![0.06; width * height],
    }
}

#[test]
fn refuses_mirrored_image() {
    let mut seen = scene().image();
    for row in seen.level.chunks_exact_mut(seen.width) {
        row.reverse();
    }
    let why = find(&board(11, 9), &seen).unwrap_err();
    assert!(matches!(why, NotFound::Mirrored { .. }), "{why}");
    // Reversing all pixels turns the image by 180 degrees without mirroring it.
    let mut seen = scene().image();
    seen.level.reverse();
    assert!(find(&board(11, 9), &seen).is_ok());
}

#[test]
fn refuses_another_board() {
    let seen = scene().image();
    for (columns, rows) in [(13, 9), (11, 11), (9, 9), (11, 7), (7, 7), (25, 19)] {
        let why = find(&board(columns, rows), &seen)
            .map(|s| s.len())
            .unwrap_err();
        assert!(
            matches!(why, NotFound::WrongBoard { .. }),
            "{columns} {rows}: {why}"
        );
        assert!(why.to_string().contains("11 x 9"), "{why}");
    }
    let Board::Dots {
        columns,
        rows,
        pitch_mm,
        dot_mm,
        marker_mm,
    } = board(11, 9)
    else {
        unreachable!()
    };
    for (dot_mm, marker_mm) in [(dot_mm * 1.3, marker_mm), (dot_mm, marker_mm * 0.8)] {
        let said = Board::Dots {
            columns,
            rows,
            pitch_mm,
            dot_mm,
            marker_mm,
        };
        let why = find(&said, &seen).map(|s| s.len()).unwrap_err();
        assert!(matches!(why, NotFound::WrongBoard { .. }), "{why}");
        assert!(why.to_string().contains("0.42"), "{why}");
    }
}

#[test]
fn refuses_too_few_markers() {
    let mut scene = scene();
    scene.hidden = vec![[7, 4], [5, 2]];
    let why = find(&scene.board, &scene.image()).unwrap_err();
    assert!(matches!(why, NotFound::Ambiguous { .. }), "{why}");
    assert!(why.to_string().contains("3 large dots"), "{why}");
}

#[test]
fn refuses_two_boards() {
    let at = |x: f64| DVec3::new(x, 0.0, 1000.0);
    let of = |x: f64| {
        let lens = small_lens(480, 200);
        Scene::new(board(11, 9), lens, pose(at(x), 5.0, 0.0, 0.0)).image()
    };
    let (mut left, right) = (of(-180.0), of(180.0));
    for (k, level) in left.level.iter_mut().enumerate() {
        if k % 480 >= 240 {
            *level = right.level[k];
        }
    }
    let why = find(&board(11, 9), &left).unwrap_err();
    assert!(why.to_string().contains("2 boards"), "{why}");
}

#[test]
fn no_board() {
    let mut draw = Draw(3);
    let noise: Vec<f64> = (0..46_000).map(|_| 100.0 + 30.0 * draw.normal()).collect();
    let spots: Vec<(f64, f64, f64)> = (0..150)
        .map(|_| {
            (
                230.0 * draw.uniform(),
                200.0 * draw.uniform(),
                2.0 + 4.0 * draw.uniform(),
            )
        })
        .collect();
    let images = [
        image(|u, v| noise[v * 230 + u]),
        image(|u, v| (u + v) as f64),
        image(|_, _| 0.0),
        image(|_, _| f64::NAN),
        image(|_, _| f64::INFINITY),
        image(|u, v| {
            let near = |s: &(f64, f64, f64)| (u as f64 - s.0).hypot(v as f64 - s.1) < s.2;
            if spots.iter().any(near) { 10.0 } else { 180.0 }
        }),
        // A chessboard, and a grid of dots without markers.
        image(|u, v| {
            if (u / 12 + v / 12) % 2 == 0 {
                10.0
            } else {
                180.0
            }
        }),
        image(|u, v| {
            let (x, y) = (u % 15, v % 15);
            if (x as f64 - 7.0).hypot(y as f64 - 7.0) < 3.2 {
                10.0
            } else {
                180.0
            }
        }),
    ];
    for (k, image) in images.iter().enumerate() {
        let why = find(&board(11, 9), image).unwrap_err();
        assert!(
            matches!(why, NotFound::Nothing { .. } | NotFound::Ambiguous { .. }),
            "{k}: {why}"
        );
    }
}

#[test]
fn refuses_malformed_images_and_boards_without_panic() {
    let of = |width: usize, height: usize, length: usize| BoardImage {
        width,
        height,
        level: vec![1.0; length],
        variance: vec![f32::NAN; length],
    };
    for image in [
        of(0, 0, 0),
        of(1, 1, 1),
        of(7, 1, 7),
        of(1, 900, 900),
        of(5, 5, 3),
        of(usize::MAX, 2, 9),
    ] {
        assert!(find(&board(11, 9), &image).is_err());
    }
    let seen = scene().image();
    for said in [
        board(0, 0),
        board(u32::MAX, u32::MAX),
        board(5, 5),
        Board::CHESS,
    ] {
        assert!(find(&said, &seen).is_err());
    }
    for (pitch_mm, dot_mm, marker_mm) in [(0.0, 0.0, 0.0), (f64::NAN, 1.0, 2.0), (1.0, -1.0, 9.0)] {
        let said = Board::Dots {
            columns: 11,
            rows: 9,
            pitch_mm,
            dot_mm,
            marker_mm,
        };
        assert!(find(&said, &seen).is_err());
    }
}
