//! Identifies a grid's markers and, from them, the board's orientation.

use super::find::Blob;
use super::lattice::{Cell, Grid, index, typical};
use crate::board::NotFound;
use phasmid_geometry::{Board, MARKERS};
use std::collections::BTreeSet;

/// Minimum number of markers that must be found at their positions.
pub(super) const ENOUGH: usize = 4;
/// Maximum number of large dots that are tried as markers.
const MOST_LARGE: usize = 32;

/// Transformation from grid to board numbering: a rotation by quarter turns, possibly with a
/// reflection, and an offset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Labels {
    turn: [[i32; 2]; 2],
    offset: [i32; 2],
}

impl Labels {
    /// Returns the grid cell of a column and row on the board.
    fn cell(&self, [column, row]: [i32; 2]) -> Cell {
        let [[a, b], [c, d]] = self.turn;
        let away = [column - self.offset[0], row - self.offset[1]];
        [a * away[0] + c * away[1], b * away[0] + d * away[1]]
    }

    /// Returns the column and row on the board of a grid cell; may be outside the board.
    pub fn index(&self, cell: Cell) -> [i32; 2] {
        let [[a, b], [c, d]] = self.turn;
        [
            a * cell[0] + b * cell[1] + self.offset[0],
            c * cell[0] + d * cell[1] + self.offset[1],
        ]
    }
}

/// The four rotations and the four reflections; the first four have a positive determinant.
const TURNS: [[[i32; 2]; 2]; 8] = [
    [[1, 0], [0, 1]],
    [[0, -1], [1, 0]],
    [[-1, 0], [0, -1]],
    [[0, 1], [-1, 0]],
    [[-1, 0], [0, 1]],
    [[0, 1], [1, 0]],
    [[1, 0], [0, -1]],
    [[0, -1], [-1, 0]],
];

/// Returns the orientation in which the grid's large dots are the board's markers; there must be
/// exactly one.
///
/// # Errors
/// Returns an error if no orientation or several fit, or if only a mirrored one does.
pub(super) fn label(board: &Board, blobs: &[Blob], grid: &Grid) -> Result<Labels, NotFound> {
    let large = markers(board, blobs, grid);
    let ways: Vec<(usize, Labels)> = TURNS
        .iter()
        .enumerate()
        .flat_map(|(k, &turn)| {
            offsets(board, &large, turn)
                .into_iter()
                .map(move |offset| (k, Labels { turn, offset }))
        })
        .filter(|(_, labels)| agrees(board, grid, &large, labels))
        .collect();
    let (turned, mirrored): (Vec<_>, Vec<_>) = ways.iter().partition(|(k, _)| *k < 4);
    match (turned.as_slice(), mirrored.as_slice()) {
        ([(_, only)], []) => Ok(*only),
        ([], [_, ..]) => Err(NotFound::Mirrored {
            found: format!(
                "{} markers among {} dots in mirrored order",
                large.len(),
                grid.len()
            ),
        }),
        (turned, _) => Err(NotFound::Ambiguous {
            found: format!(
                "{} in a grid of {}, which fit in {} ways",
                count(large.len(), "large dot"),
                count(grid.len(), "dot"),
                turned.len()
            ),
            wanted: format!(
                "at least {ENOUGH} of the {} markers in their places and no other large dot",
                MARKERS.len()
            ),
        }),
    }
}

fn count(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

/// Cells whose dots are larger than their neighbours by the ratio expected of markers.
fn markers(board: &Board, blobs: &[Blob], grid: &Grid) -> Vec<Cell> {
    let Board::Dots {
        dot_mm, marker_mm, ..
    } = *board
    else {
        return Vec::new();
    };
    // A dot is a marker if its area exceeds its neighbours' by this ratio, which is the geometric
    // mean of 1 and the markers' ratio.
    let limit = marker_mm / dot_mm;
    grid.iter()
        .filter(|&(&cell, &k)| {
            typical(cell, |c| grid.get(&c).map(|&k| blobs[k].mass))
                .is_some_and(|usual| blobs[k].mass > limit * usual)
        })
        .map(|(&cell, _)| cell)
        .collect()
}

/// Candidate offsets, each of which maps a large dot to a marker.
fn offsets(board: &Board, large: &[Cell], turn: [[i32; 2]; 2]) -> BTreeSet<[i32; 2]> {
    let unmoved = Labels {
        turn,
        offset: [0, 0],
    };
    large
        .iter()
        .take(MOST_LARGE)
        .flat_map(|&cell| {
            let at = unmoved.index(cell);
            places(board).map(move |place| [place[0] - at[0], place[1] - at[1]])
        })
        .collect()
}

/// Columns and rows of the board's markers.
fn places(board: &Board) -> impl Iterator<Item = [i32; 2]> + use<> {
    let [columns, rows] = board.grid().map(|n| (n / 2) as i32);
    MARKERS.iter().map(move |m| [columns + m[0], rows + m[1]])
}

/// Tests labels: at least `ENOUGH` markers must be large dots, no dot at a marker's position may be
/// small, and no other dot on the board may be large. Dots outside the board are ignored.
fn agrees(board: &Board, grid: &Grid, large: &[Cell], labels: &Labels) -> bool {
    let markers: Vec<Cell> = places(board).map(|place| labels.cell(place)).collect();
    let seen = markers.iter().filter(|cell| grid.contains_key(*cell));
    let agreeing = markers.iter().filter(|cell| large.contains(cell)).count();
    let within = large
        .iter()
        .filter(|&&cell| index(board, labels.index(cell)).is_some());
    agreeing >= ENOUGH && agreeing == seen.count() && agreeing == within.count()
}
