//! A board in a picture, whatever its kind.

use super::{NotFound, Picture, Seen, chess, dots};
use phasmid_geometry::Board;

/// The board's points that a picture shows, labelled: all of a chessboard's corners, or those dots
/// that are in the picture.
///
/// # Errors
/// No such board, or one that cannot be told which way round it is; see [`dots::find`] and
/// [`chess::find`].
pub fn find(board: &Board, picture: &Picture) -> Result<Vec<Seen>, NotFound> {
    match board {
        Board::Dots { .. } => dots::find(board, picture),
        Board::Chess { .. } => chess::find(board, picture),
    }
}
