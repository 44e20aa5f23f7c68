//! Which corner of a grid is the board's first.
//!
//! The board's x and y go round clockwise on the screen, as they do for somebody in front of it, so
//! four turns are left. Where columns and rows differ in number, two of them fit; the square before
//! the first corner, which is dark, decides between those, if columns and rows together are an odd
//! number. If they are an even one, half a turn takes the board to itself, colours and all. Then the
//! turn is taken that has the first corner uppermost (of two as high, leftmost): either way round
//! the points lie where they would on the same board, so that it makes no difference to a
//! calibration, which has each pose of the board to itself. For the same reason a mirrored picture
//! of a chessboard cannot be told from a true one.

use super::grid::Grid;
use glam::DVec2;

/// Row and column in the grid of the board's first corner and of steps along its columns and rows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Labels {
    first: [i32; 2],
    steps: [[i32; 2]; 2],
    /// Whether the square before the first corner is dark.
    pub(super) dark: bool,
}

impl Labels {
    /// Place in the grid of a corner of the board.
    pub(super) fn place(&self, [column, row]: [i32; 2]) -> [i32; 2] {
        [0, 1].map(|i| self.first[i] + self.steps[0][i] * column + self.steps[1][i] * row)
    }
}

/// The labels for a grid with `columns` and `rows` (in any order); `px` gives the place of its corners.
pub(super) fn labels(
    grid: &Grid,
    board: [u32; 2],
    px: &dyn Fn([i32; 2]) -> DVec2,
) -> Option<Labels> {
    let (low, size) = grid.bounds();
    let last = [0, 1].map(|i| low[i] + size[i] as i32 - 1);
    // Turned by quarters: x of the board along x, y, -x, -y of the grid.
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
            // A quarter turn has another pair of squares before a corner; so has a step.
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
