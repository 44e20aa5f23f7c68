//! Compares the ink coverage of pieces of boards on the GPU with the coverage on the CPU.

use crate::gpu::Engine;
use glam::{DVec2, Vec2};
use phasmid_geometry::Board;

/// Returns a board in the layout of `board.wgsl`.
fn words(board: &Board) -> [u32; 7] {
    let [columns, rows] = board.grid();
    let (is_dots, [dot, marker]) = match *board {
        Board::Dots {
            dot_mm, marker_mm, ..
        } => (1, [dot_mm / 2.0, marker_mm / 2.0]),
        Board::Chess { .. } => (0, [0.0; 2]),
    };
    let pitch = board.pitch_mm();
    let numbers = [
        columns.into(),
        rows.into(),
        pitch,
        dot,
        marker,
        board.mean_ink(),
    ];
    let [a, b, c, d, e, f] = numbers.map(|v| (v as f32).to_bits());
    [is_dots, a, b, c, d, e, f]
}

fn boards() -> [Board; 4] {
    let tight = Board::Dots {
        columns: 12,
        rows: 9,
        pitch_mm: 10.0,
        dot_mm: 7.0,
        marker_mm: 12.5,
    };
    let fine = Board::Chess {
        columns: 199,
        rows: 198,
        pitch_mm: 1.5,
    };
    [Board::DOTS.scaled(4.0), tight, Board::CHESS, fine]
}

/// Returns quasi-random numbers in [0, 1).
fn dice(k: usize, root: f64) -> f64 {
    ((k + 1) as f64 * root.sqrt()).fract()
}

/// Returns the position of a parallelogram on a board, and its two sides.
fn piece(board: &Board, k: usize) -> [Vec2; 3] {
    let pitch = board.pitch_mm();
    let place = |root| 2.4 * dice(k, root) - 1.2;
    let about = DVec2::new(place(2.0), place(3.0));
    let at = match k % 5 {
        0 => pitch * 3.0 * about,
        1 => board.point([3, 2]),
        2 => board.point([3, 2]) + DVec2::from_angle(5.0 * place(2.0)) * board.radius_mm([3, 2]),
        _ => board.sheet_mm() / 2.0 * about,
    };
    // Sizes range from a thousandth of a pitch to twenty pitches.
    let size = |root| pitch * 1e-3 * 2e4f64.powf(dice(k, root));
    let turn = DVec2::from_angle(6.3 * dice(k, 5.0));
    let (across, other) = (turn * size(7.0), turn.perp());
    let down = match k % 3 {
        0 => other * size(11.0),
        1 => other * across.length(),
        _ => other * across.length() + across * place(13.0),
    };
    let upright = k.is_multiple_of(7);
    let [across, down] = match upright {
        true => [DVec2::X * across.length(), DVec2::NEG_Y * down.length()],
        false => [across, down],
    };
    [at, across, down].map(|v| v.as_vec2())
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_boards_have_the_ink_of_the_cpu() {
    let mut engine = Engine::for_tests();
    for board in boards() {
        let cases: Vec<[Vec2; 3]> = (0..20_000).map(|k| piece(&board, k)).collect();
        let words = words(&board);
        let of = |case: &[Vec2; 3]| {
            let numbers = case.map(|v| v.to_array());
            let numbers = numbers.as_flattened().iter().map(|v| v.to_bits());
            words.into_iter().chain(numbers).collect::<Vec<u32>>()
        };
        let input: Vec<u32> = cases.iter().flat_map(of).collect();
        let output = engine.call("tests/board_test", &input, cases.len(), cases.len());
        let (mut worst, mut off) = (0.0f64, 0);
        for (case, found) in cases.iter().zip(output) {
            let [at, across, down] = case.map(|v| v.as_dvec2());
            let exact = board.ink(at, across, down);
            let error = (f64::from(f32::from_bits(found)) - exact).abs();
            // Rounding error relative to the size of the piece.
            let size = across.abs() + down.abs();
            let far = at.abs().max_element() + size.max_element();
            let width = across.perp_dot(down).abs() / size.max_element();
            let bar = 2e-5 + 4e-7 * far / width;
            if error > bar {
                off += 1;
                println!(
                    "{case:?}: {} for {exact}, bar {bar:.1e}",
                    f32::from_bits(found)
                );
            }
            worst = worst.max(if error > bar { 0.0 } else { error });
        }
        println!("{board:?}: {worst:.1e} at most, {off} beyond their bars");
        // CPU and GPU differ only where rounding decides the cell count.
        assert!(off <= cases.len() / 1000, "{board:?}: {off}");
    }
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_boards_handle_degenerate_footprints() {
    let board = Board::DOTS;
    let huge = Vec2::splat(1e20);
    let marker = board.point([12, 9]).as_vec2();
    let cases = [
        ([marker, Vec2::ZERO, Vec2::ZERO], 1.0),
        ([marker + 2.6 * Vec2::X, Vec2::ZERO, Vec2::ZERO], 0.0),
        ([marker, Vec2::ONE, 2.0 * Vec2::ONE], 1.0),
        ([marker, huge, huge.perp()], 0.0),
        ([huge, Vec2::X, Vec2::Y], 0.0),
        ([huge, Vec2::ZERO, Vec2::ZERO], 0.0),
        ([Vec2::splat(f32::NAN), Vec2::X, Vec2::Y], 0.0),
    ];
    let input: Vec<u32> = cases
        .iter()
        .flat_map(|(case, _)| {
            let numbers = case.map(|v| v.to_array());
            let numbers: Vec<u32> = numbers.as_flattened().iter().map(|v| v.to_bits()).collect();
            words(&board).into_iter().chain(numbers)
        })
        .collect();
    let mut engine = Engine::for_tests();
    let output = engine.call("tests/board_test", &input, cases.len(), cases.len());
    for ((case, wanted), found) in cases.iter().zip(output) {
        assert_eq!(f32::from_bits(found), *wanted, "{case:?}");
    }
}
