//! The image in which a board is searched.
//!
//! - `frames`: combines the frames of a sequence into one image.
//! - `rounding`: variance caused by rounding in frames that all show the same level.

mod frames;
mod rounding;
#[cfg(test)]
mod tests;

/// One image combined from all frames of a pose: linear in light, with a noise estimate.
#[derive(Debug, Clone, PartialEq)]
pub struct BoardImage {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Signal above black in DN of one frame, row by row; NaN where a frame is saturated.
    pub level: Vec<f32>,
    /// Variance of each level, in DN squared.
    pub variance: Vec<f32>,
}
