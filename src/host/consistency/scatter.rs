//! Pixels from everywhere in the image, for what strikes a few rows or single pixels.

use super::grid::{full_scale, value};
use phasmid_pattern::Image;

/// Pixels that tell of a few damaged ones; of smaller images all.
pub(super) const MANY: usize = 40_000;
/// Pixels that tell of hundredths of them.
pub(super) const FEW: usize = 2_500;

/// Pixels with their values in every frame; those at the camera's full scale are left out.
pub(super) struct Scatter {
    frames: usize,
    values: Vec<f32>,
}

impl Scatter {
    /// About so many pixels of frames of one size and format.
    pub(super) fn new(frames: &[Image], pixels: usize) -> Self {
        let (width, height) = frames.first().map_or((0, 0), |f| (f.width(), f.height()));
        let stride = (width * height / pixels).max(1);
        let mut values = Vec::with_capacity(width * height / stride * frames.len());
        for row in 0..height {
            // Every row at other columns.
            for column in (row * 7 % stride..width).step_by(stride) {
                let index = row * width + column;
                values.extend(frames.iter().map(|frame| value(frame, index)));
            }
        }
        let count = frames.len().max(1);
        let full = full_scale(values.iter().copied());
        let mut kept = Vec::with_capacity(values.len());
        for pixel in values.chunks_exact(count) {
            if pixel.iter().all(|v| *v < full) {
                kept.extend_from_slice(pixel);
            }
        }
        Self {
            frames: count,
            values: kept,
        }
    }

    /// Pixels.
    pub(super) fn len(&self) -> usize {
        self.values.len() / self.frames
    }

    /// A pixel's value in every frame, in DN, pixel by pixel.
    pub(super) fn pixels(&self) -> impl Iterator<Item = &[f32]> {
        self.values.chunks_exact(self.frames)
    }
}
