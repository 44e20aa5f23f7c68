//! Determines which corner of a grid is the board's first.
//!
//! Seen from the front, the board's y axis is clockwise of its x axis in the image, which leaves
//! four rotations. If the numbers of columns and rows differ, two rotations fit. If the sum of both
//! numbers is odd, the colour of the square before the first corner, which is dark, decides between
//! the two. If the sum is even, half a turn maps the board to itself, colours included; then the
//! first corner is the uppermost candidate (the leftmost of equally high candidates). Either way
//! the points lie at positions of the same board, so the choice does not affect a calibration,
//! which estimates each pose of the board separately. For the same reason a mirrored image of a
//! chessboard cannot be distinguished from a true one.

use super::grid::Grid;
use glam::DVec2;

/// First corner of the board in the grid, and the steps along the board's columns and rows, as
/// (row, column) of the grid.
#[derive(Debug, Clone, Copy)]
pub(super) struct Labels {
    first: [i32; 2],
    steps: [[i32; 2]; 2],
    /// Whether the square before the first corner (diagonally outside it) is dark.
    pub(super) dark: bool,
}

impl Labels {
    /// Returns the grid position of a corner of the board.
    pub(super) fn place(&self, [column, row]: [i32; 2]) -> [i32; 2] {
        [0, 1].map(|i| self.first[i] + self.steps[0][i] * column + self.steps[1][i] * row)
    }
}

/// Returns the labels for a grid, or `None` if its numbers of columns and rows differ from the
/// board's in either order. `px` gives the positions of the grid's corners.
pub(super) fn labels(
    grid: &Grid,
    board: [u32; 2],
    px: &dyn Fn([i32; 2]) -> DVec2,
) -> Option<Labels> {
    let (low, size) = grid.bounds();
    let last = [0, 1].map(|i| low[i] + size[i] as i32 - 1);
    // Rotations by quarter turns: the board's x along x, y, -x, -y of the grid.
    let turns = [
        ([low[1], low[0]], [[0, 1], [1, 0]]),
        ([low[1], last[0]], [[1, 0], [0, -1]]),
        ([last[1], last[0]], [[0, -1], [-1, 0]]),
        ([last[1], low[0]], [[-1, 0], [0, 1]]),
    ];
    let fits = turns
        .into_iter()
        .enumerate()
        .filter_map(|(quarters, (first, steps))| {
            let along = if quarters % 2 == 0 {
                size
            } else {
                [size[1], size[0]]
            };
            // A quarter turn swaps dark and light around a corner; so does a step to the next
            // corner.
            let odd = (first[0] + first[1]).rem_euclid(2) + quarters as i32;
            let dark = grid.dark == (odd % 2 == 0);
            (along == board).then_some(Labels { first, steps, dark })
        });
    let before = |a: &Labels, b: &Labels| {
        let (p, q) = (px(a.first), px(b.first));
        b.dark
            .cmp(&a.dark)
            .then(p.y.total_cmp(&q.y))
            .then(p.x.total_cmp(&q.x))
    };
    fits.min_by(before)
}
