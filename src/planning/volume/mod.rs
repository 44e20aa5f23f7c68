//! Volumes: a grid in the patient frame with a value or a displacement at each voxel's centre.

mod field;
mod grid;
mod scalar;
#[cfg(test)]
mod tests;

pub use field::Field;
pub use grid::Grid;
pub(super) use grid::listed;
pub use scalar::{Volume, Voxels};
