//! A picture to look for a board in.

mod frames;
mod rounding;
#[cfg(test)]
mod tests;

/// One picture made of all frames of a pose: linear in light, with what is known of its noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Signal above black in digital numbers of one frame, row by row. NaN where a frame is saturated.
    pub level: Vec<f32>,
    /// Variance of each level.
    pub variance: Vec<f32>,
}
