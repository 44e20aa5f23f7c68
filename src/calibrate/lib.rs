//! Lenses and rigs: from pictures of a board to a calibration, from projector coordinates to points.

pub mod board;
pub mod files;
pub mod height;
pub mod poses;
pub mod report;
pub mod rig;
pub mod solve;

pub use phasmid_decode::triangulate::{CoordinateRow, Measured, Triangulator};
