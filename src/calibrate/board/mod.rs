//! What a camera has seen of a board, and where the projector lit it.

pub mod dots;
mod not_found;
mod picture;
mod sighting;

pub use not_found::NotFound;
pub use picture::Picture;
pub use sighting::{Lit, Seen, Sighting};
