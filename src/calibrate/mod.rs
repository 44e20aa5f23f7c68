//! Lenses and rigs: from projector coordinates to points.

mod triangulate;

pub use triangulate::{CoordinateRow, Measured, Triangulator};
