//! Finds a board of either kind in an image.

use super::{BoardImage, NotFound, Seen, chess, dots};
use phasmid_core::Stop;
use phasmid_geometry::Board;

/// Finds the board's points in an image and returns them with their labels: of a dot board those
/// dots that are visible, of a chessboard almost all corners.
///
/// # Errors
/// Returns an error if the board is not found or its orientation is ambiguous; see [`dots::find`]
/// and [`chess::find`].
pub fn find(board: &Board, image: &BoardImage) -> Result<Vec<Seen>, NotFound> {
    search(board, image, &Stop::default())
}

/// [`find`], which returns [`NotFound::Interrupted`] soon after `stop` is asked.
pub(crate) fn search(
    board: &Board,
    image: &BoardImage,
    stop: &Stop,
) -> Result<Vec<Seen>, NotFound> {
    match board {
        Board::Dots { .. } => dots::search(board, image, stop),
        Board::Chess { .. } => chess::search(board, image, stop),
    }
}

/// Returns an error if the search has been asked to end.
pub(super) fn check(stop: &Stop) -> Result<(), NotFound> {
    stop.check().map_err(|_| NotFound::Interrupted)
}
