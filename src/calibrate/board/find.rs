//! Finds a board of either kind in an image.

use super::{BoardImage, NotFound, Seen, chess, dots};
use phasmid_geometry::Board;

/// Finds the board's points in an image and returns them with their labels: of a dot board those
/// dots that are visible, of a chessboard almost all corners.
///
/// # Errors
/// Returns an error if the board is not found or its orientation is ambiguous; see [`dots::find`]
/// and [`chess::find`].
pub fn find(board: &Board, image: &BoardImage) -> Result<Vec<Seen>, NotFound> {
    match board {
        Board::Dots { .. } => dots::find(board, image),
        Board::Chess { .. } => chess::find(board, image),
    }
}
