//! What a camera has seen of a board, and where the projector lit it.

pub mod bias;
mod biweight;
pub mod chess;
pub mod dots;
mod draw;
mod find;
pub mod lit;
mod not_found;
mod picture;
mod sighting;
mod smooth;

pub use draw::draw;
pub use find::find;
pub use not_found::NotFound;
pub use picture::Picture;
pub use sighting::{Lit, Seen, Sighting};
