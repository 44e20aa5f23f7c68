//! Finds a calibration board in camera images and reads the projector coordinates at its points.
//!
//! - `image`: the image a board is searched in, combined from all frames of a sequence.
//! - `find`, `dots`, `chess`: locate and measure the board's points.
//! - `lit`: projector coordinates at those points; `smooth` is a robust fit for it.
//! - `bias`: offset between the centroid of an imaged dot and the image of its centre.
//! - `sighting`: measured points; `not_found`: reasons for a failed search.
//! - `draw`: image of the result, for inspection.

pub mod bias;
pub mod chess;
pub mod dots;
mod draw;
mod find;
mod image;
pub mod lit;
mod not_found;
mod sighting;
mod smooth;

pub use draw::draw;
pub use find::find;
pub(crate) use find::search;
pub use image::BoardImage;
pub use not_found::NotFound;
pub use sighting::{Lit, Seen, Sighting};
