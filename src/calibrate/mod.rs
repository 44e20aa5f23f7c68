//! Lenses and rigs: from pictures of a board to a calibration, from projector coordinates to points.

pub mod board;
pub mod files;
pub mod height;
pub mod poses;
pub mod report;
pub mod rig;
pub mod solve;
mod triangulate;

pub use triangulate::{CoordinateRow, Measured, Triangulator};
