//! Finds a calibration board in camera images and reads the projector coordinates at its points.
//!
//! - `image`: the image a board is searched in, combined from all frames of a sequence.
//! - `dots`, `chess`: locate and measure the board's points.
//! - `lit`: projector coordinates at those points; `smooth`: the robust fit of a smooth map that
//!   `lit` uses.
//! - `bias`: offset between the centroid of an imaged dot and the image of its centre.
//! - `sighting`: measured points, and reasons for a failed search.
//! - `draw`: draws the measured points into the image, for inspection.

pub mod bias;
pub mod chess;
pub mod dots;
mod draw;
mod image;
pub mod lit;
mod sighting;
mod smooth;

pub use draw::draw;
pub use image::BoardImage;
pub use sighting::{Lit, NotFound, Seen, Sighting};

use phasmid_core::Stop;
use phasmid_geometry::Board;

/// Finds the board's points in an image and returns them with their labels: all visible dots of a
/// dot board, or almost all corners of a chessboard.
///
/// # Errors
/// Returns an error if the board is not found or its orientation is ambiguous; see [`dots::find`]
/// and [`chess::find`].
pub fn find(board: &Board, image: &BoardImage) -> Result<Vec<Seen>, NotFound> {
    search(board, image, &Stop::default())
}

/// Like [`find`], but returns [`NotFound::Interrupted`] soon after a stop is requested.
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
