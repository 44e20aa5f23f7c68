//! Skin data from the geometry pass for the later passes.

use super::blend::Spread;
use crate::skin::{NONE, SkinMaterial};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Skin maps over the camera's pixels, row-major. The projector coordinates in the geometry buffer
/// still belong to the surface point and serve as ground truth, so that measurements show the error
/// that skin causes.
#[derive(Debug, Clone)]
pub(crate) struct SkinMaps {
    /// Projector column and row where the light seen at the pixel centre entered the surface: the
    /// point's own coordinates, shifted on skin.
    pub(crate) from: [Vec<f32>; 2],
    /// Projector pixels per millimetre of skin along the gradients of column and row.
    pub(crate) px_per_mm: Vec<[f32; 2]>,
    /// Index of the tissue; `NONE` for pixels that are not lit skin.
    pub(crate) tissue: Vec<u16>,
    pub(crate) materials: Arc<[SkinMaterial]>,
}

/// Skin data of the sixteen samples of a mixed pixel. Their projector coordinates are already
/// shifted.
#[derive(Debug, Clone)]
pub(crate) struct Samples {
    pub(crate) px_per_mm: [[f32; 2]; 16],
    pub(crate) tissue: [u16; 16],
}

impl Default for Samples {
    fn default() -> Self {
        Self {
            px_per_mm: [[0.0; 2]; 16],
            tissue: [NONE; 16],
        }
    }
}

#[cfg(test)]
impl Samples {
    /// Returns the projector pixels per millimetre of a sample's skin, and the index of its tissue.
    pub(crate) fn at(&self, k: usize) -> ([f32; 2], u16) {
        (self.px_per_mm[k], self.tissue[k])
    }
}

impl SkinMaps {
    /// Returns the projector pixels per millimetre of a pixel's skin, and the index of its tissue.
    #[cfg(test)]
    pub(crate) fn at(&self, i: usize) -> ([f32; 2], u16) {
        (self.px_per_mm[i], self.tissue[i])
    }

    /// Returns the spread of the projected light at a pixel along one axis of the pattern image;
    /// `None` if the pixel is not lit skin.
    pub(crate) fn spread(&self, i: usize, axis: usize) -> Option<Spread<'_>> {
        self.of(self.tissue[i], self.px_per_mm[i], axis)
    }

    /// Returns [`Self::spread`] for a sample of a mixed pixel.
    pub(crate) fn sample(&self, samples: &Samples, k: usize, axis: usize) -> Option<Spread<'_>> {
        self.of(samples.tissue[k], samples.px_per_mm[k], axis)
    }

    fn of(&self, tissue: u16, px_per_mm: [f32; 2], axis: usize) -> Option<Spread<'_>> {
        let material = self.materials.get(usize::from(tissue))?;
        Some(Spread {
            mixture: &material.mixture,
            px_per_mm: px_per_mm[axis],
        })
    }

    /// Returns the fraction of contrast that skin leaves of a fringe with a period of `period`
    /// projector pixels along an axis.
    pub(crate) fn contrast(&self, i: usize, axis: usize, period: f64) -> f64 {
        self.spread(i, axis).map_or(1.0, |spread| {
            let frequency = f64::from(spread.px_per_mm) / period;
            spread.mixture.transfer(TAU * frequency)
        })
    }
}
