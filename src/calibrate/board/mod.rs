//! What a camera has seen of a board, and where the projector lit it.

pub mod bias;
mod biweight;
pub mod chess;
pub mod dots;
mod draw;
pub mod lit;
mod not_found;
mod picture;
mod sighting;
mod smooth;

pub use draw::draw;
pub use not_found::NotFound;
pub use picture::Picture;
pub use sighting::{Lit, Seen, Sighting};

use crate::geometry::Board;

/// Finds a board's points in a picture.
///
/// # Errors
/// A picture that shows no board, or another, or leaves open which way round it is.
pub fn find(board: &Board, picture: &Picture) -> Result<Vec<Seen>, NotFound> {
    match board {
        Board::Dots { .. } => dots::find(board, picture),
        Board::Chess { .. } => chess::find(board, picture),
    }
}
