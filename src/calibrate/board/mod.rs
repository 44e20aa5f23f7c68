//! What a camera has seen of a board, and where the projector lit it.

mod picture;
mod sighting;

pub use picture::Picture;
pub use sighting::{Lit, Seen, Sighting};
