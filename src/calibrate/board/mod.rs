//! What a camera has seen of a board, and where the projector lit it.

pub mod chess;
pub mod dots;
mod draw;
mod find;
mod not_found;
mod picture;
mod sighting;

pub use draw::draw;
pub use find::find;
pub use not_found::NotFound;
pub use picture::Picture;
pub use sighting::{Lit, Seen, Sighting};
