use super::*;

/// A chessboard and two boards of dots, one with dots that nearly touch.
fn boards() -> [Board; 3] {
    let tight = Board::Dots {
        columns: 11,
        rows: 9,
        pitch_mm: 10.0,
        dot_mm: 7.0,
        marker_mm: 12.0,
    };
    [Board::DOTS.scaled(4.0), tight, Board::CHESS]
}

/// Brute-force reference; tests the given dots only.
fn is_ink(board: &Board, dots: &[[u32; 2]], p: DVec2) -> bool {
    match *board {
        Board::Dots { .. } => dots
            .iter()
            .any(|&i| p.distance(board.point(i)) <= board.radius_mm(i)),
        Board::Chess {
            columns,
            rows,
            pitch_mm,
        } => {
            let first = board.point([0, 0]) - pitch_mm;
            let cell = ((p - first) / pitch_mm).floor();
            let last = DVec2::new(columns.into(), rows.into());
            cell.cmpge(DVec2::ZERO).all()
                && cell.cmple(last).all()
                && (cell.x + cell.y).rem_euclid(2.0) == 0.0
        }
    }
}

fn counted(board: &Board, at: DVec2, across: DVec2, down: DVec2, n: u32) -> f64 {
    let place = |k: u32| (f64::from(k) + 0.5) / f64::from(n) - 0.5;
    let reach = across.length() + down.length();
    let near = |i: &[u32; 2]| at.distance(board.point(*i)) <= reach + board.radius_mm(*i);
    let dots: Vec<[u32; 2]> = board.indices().filter(near).collect();
    let is_ink = |k: &u32| {
        is_ink(
            board,
            &dots,
            at + across * place(k % n) + down * place(k / n),
        )
    };
    let found = (0..n * n).filter(is_ink).count();
    found as f64 / f64::from(n * n)
}

/// Total printed area in square millimetres.
fn printed(board: &Board) -> f64 {
    match board {
        Board::Dots { .. } => {
            let areas = board.indices().map(|i| PI * board.radius_mm(i).powi(2));
            areas.sum()
        }
        Board::Chess {
            columns,
            rows,
            pitch_mm,
        } => f64::from(((columns + 1) * (rows + 1)).div_ceil(2)) * pitch_mm.powi(2),
    }
}

/// Quasi-random number in [0, 1).
fn dice(k: u32, root: f64) -> f64 {
    (f64::from(k + 1) * root.sqrt()).fract()
}

#[test]
fn a_piece_has_the_ink_that_samples_find() {
    for board in boards() {
        let (pitch, half) = (board.pitch_mm(), board.sheet_mm() / 2.0);
        let mut worst = 0.0f64;
        for k in 0..60 {
            let place = |root| 2.2 * dice(k, root) - 1.1;
            let at = match k % 3 {
                // A third of the pieces lie around the markers, the others anywhere on the sheet or
                // beyond its border.
                0 => pitch * 3.0 * DVec2::new(place(2.0), place(3.0)),
                _ => half * DVec2::new(place(2.0), place(3.0)),
            };
            let turn = DVec2::from_angle(6.3 * dice(k, 5.0));
            let size = |root| pitch * 3.0 * dice(k, root).powi(2) + 0.01 * pitch;
            let across = turn * size(7.0);
            let down = turn.perp() * size(11.0) + across * (dice(k, 13.0) - 0.5);
            let down = if k % 2 == 0 { down } else { -down };
            let error = board.ink(at, across, down) - counted(&board, at, across, down, 200);
            worst = worst.max(error.abs());
        }
        // An edge parallel to a row of samples is resolved to half a row.
        assert!(worst < 3e-3, "{board:?}: {worst:.1e}");
    }
}

#[test]
fn pieces_of_the_sheet_have_all_that_is_printed() {
    for board in boards() {
        let sheet = board.sheet_mm();
        for (n, turn) in [(7, 0.0), (20, 0.0), (61, 0.7), (90, 2.1)] {
            let turn = DVec2::from_angle(turn);
            let side = 1.5 * sheet.max_element() / f64::from(n);
            let (across, down) = (turn * side, (turn.perp() + 0.3 * turn) * side);
            let area = side * side;
            let mut sum = 0.0;
            for i in -n..=n {
                for j in -n..=n {
                    let at = across * f64::from(i) + down * f64::from(j);
                    sum += board.ink(at, across, down) * area;
                }
            }
            // Large pieces use the mean of the grid.
            let error = sum / printed(&board) - 1.0;
            assert!(error.abs() < 1e-11, "{board:?} {n}: {error:.1e}");
        }
    }
}

#[test]
fn simple_pieces_have_closed_forms() {
    let board = Board::DOTS;
    let (dot, r) = (board.point([0, 0]), 1.25);
    let share = |at: DVec2, x: f64, y: f64| board.ink(dot + at, DVec2::X * x, DVec2::Y * y);
    let near = |found: f64, exact: f64| {
        assert!((found - exact).abs() < 1e-14, "{found} for {exact}");
    };
    // A parallelogram that covers the whole dot, then half of the dot, then a quarter.
    near(share(DVec2::ZERO, 4.0, 4.0), PI * r * r / 16.0);
    near(share(DVec2::X * 1.5, 3.0, 4.0), PI * r * r / 2.0 / 12.0);
    near(share(DVec2::splat(1.5), 3.0, 3.0), PI * r * r / 4.0 / 9.0);
    // A piece inside the dot, then a piece whose four sides all cross the dot's outline.
    near(share(DVec2::new(0.2, -0.1), 1.0, 1.0), 1.0);
    let h: f64 = 1.0;
    let cap = r * r * (h / r).acos() - h * (r * r - h * h).sqrt();
    near(share(DVec2::ZERO, 2.0, 2.0), (PI * r * r - 4.0 * cap) / 4.0);
    // One side cuts off a cap.
    near(share(DVec2::X * 2.0, 2.0, 4.0), cap / 8.0);
    // A piece beside the dot; then a side whose ends lie outside the circle and whose middle lies
    // inside.
    near(share(DVec2::new(1.76, 0.0), 1.0, 1.0), 0.0);
    let bulge = r * r * (1.0f64 / r).acos() - (r * r - 1.0f64).sqrt();
    near(share(DVec2::Y * 1.5, 3.0, 1.0), bulge / 3.0);
    // A rhombus whose sides nearly touch the dot from outside.
    let side = r * 2f64.sqrt() * (1.0 + 1e-15);
    let rhombus = board.ink(dot, DVec2::new(side, side), DVec2::new(-side, side));
    near(rhombus, PI * r * r / (2.0 * side * side));
    // Squares of a chessboard.
    let chess = Board::CHESS;
    let at = chess.point([3, 2]);
    near(chess.ink(at, DVec2::X * 4.0, DVec2::Y * 6.0), 0.5);
    let shifted = chess.ink(at + DVec2::X, DVec2::X * 4.0, DVec2::Y * 6.0);
    near(shifted, 0.5);
    let dark = chess.ink(at + DVec2::ONE, DVec2::X * 4.0, DVec2::Y * 6.0);
    near(dark, (3.0 * 2.0 + 1.0 * 4.0) / 24.0);
}

#[test]
fn places_slivers_and_no_numbers_have_ink_too() {
    let board = Board::DOTS.scaled(4.0);
    let marker = board.point([12, 9]);
    assert!(board.is_marker([12, 9]));
    let point = |at: DVec2| board.ink(at, DVec2::ZERO, DVec2::ZERO);
    assert_eq!(point(marker), 1.0);
    assert_eq!(point(marker + DVec2::X * 9.99), 1.0);
    assert_eq!(point(marker + DVec2::X * 10.01), 0.0);
    assert_eq!(point(board.point([0, 0]) + DVec2::Y * 5.01), 0.0);
    assert_eq!(point(DVec2::splat(1e300)), 0.0);
    // Two collinear sides span no area.
    assert_eq!(board.ink(marker, DVec2::ONE, DVec2::ONE * 3.0), 1.0);
    // Tiny pieces across an edge, wide thin pieces, huge pieces.
    for size in [1e-3, 1e-6] {
        let half = board.ink(
            marker + DVec2::X * 10.0,
            DVec2::X * size,
            DVec2::Y * size * 1e-3,
        );
        assert!((half - 0.5).abs() < 1e-6, "{size}: {half}");
    }
    let thin = board.ink(marker, DVec2::X * 30.0, DVec2::Y * 1e-5);
    assert!((thin - 2.0 / 3.0).abs() < 1e-6, "{thin}");
    let all = board.ink(DVec2::ZERO, DVec2::X * 1e5, DVec2::Y * 1e5) * 1e10;
    assert!((all / printed(&board) - 1.0).abs() < 1e-12);
    let sheet = board.sheet_mm();
    let mean = board.ink(DVec2::NAN, DVec2::X, DVec2::Y);
    assert!((mean * sheet.x * sheet.y / printed(&board) - 1.0).abs() < 1e-12);
    assert!(board.ink(marker, DVec2::X * f64::INFINITY, DVec2::Y) == mean);
    for nothing in [[0, 0], [1, 1], [u32::MAX, u32::MAX]] {
        let [columns, rows] = nothing;
        let board = Board::Chess {
            columns,
            rows,
            pitch_mm: f64::NAN,
        };
        // Any result is accepted, but the call must return quickly.
        board.ink(DVec2::ZERO, DVec2::X, DVec2::Y);
        board.ink(DVec2::ZERO, DVec2::ZERO, DVec2::Y);
    }
}

#[test]
fn the_sheet_holds_the_grid_and_its_margin() {
    assert_eq!(Board::DOTS.sheet_mm(), DVec2::new(156.0, 120.0));
    assert_eq!(Board::CHESS.sheet_mm(), DVec2::new(275.0, 200.0));
    for board in boards() {
        let edge = board.sheet_mm() / 2.0;
        for at in [
            edge,
            -edge,
            DVec2::new(edge.x, 0.0),
            DVec2::new(0.0, edge.y),
        ] {
            let pitch = board.pitch_mm();
            assert_eq!(
                board.ink(at, DVec2::X * pitch * 0.6, DVec2::Y * pitch * 0.6),
                0.0
            );
        }
    }
}
