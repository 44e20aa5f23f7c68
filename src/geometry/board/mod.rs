//! Calibration boards: a grid of dots or of chessboard corners, used for rendering, printing and
//! detection.
//!
//! The origin of a board's frame is the centre of the grid; x runs along increasing columns, y
//! along increasing rows, z into the board. An observer in front of it looking along +z sees x to
//! the right and y down, so the pose of a board that faces a camera is near the identity.

mod check;
mod ink;
mod kind;
mod parallelogram;

pub use kind::{Board, MARKERS};
