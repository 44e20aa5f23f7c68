//! Calibration boards: a grid of dots or of chessboard corners, as a scene draws it, a printer
//! prints it and a detector looks for it.
//!
//! A board's frame has its origin in the middle of the grid, x along its columns' numbers, y along
//! its rows', z into the board: somebody in front of it, looking along +z, sees x to the right and y
//! down, so that the pose of a board that faces a camera is near the identity.

mod check;
mod ink;
mod kind;
mod parallelogram;
mod points;

pub use kind::Board;
pub use points::MARKERS;
