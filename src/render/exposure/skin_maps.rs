//! Data about skin that the geometry pass hands to the later passes.

use super::blend::Spread;
use crate::skin::{NONE, SkinMaterial};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Skin maps over the camera's pixels, row-major. The projector coordinates in the geometry buffer
/// belong to the surface point that the pixel sees and serve as ground truth, so that measurements
/// show the error that skin causes.
#[derive(Debug, Clone)]
pub(crate) struct SkinMaps {
    /// Projector column and row at which the light seen at the pixel's centre entered the surface:
    /// the surface point's own coordinates, which are shifted on skin.
    pub(crate) from: [Vec<f32>; 2],
    /// How fast the projector's column and row change on the skin, in projector pixels per
    /// millimetre, each along its gradient.
    pub(crate) px_per_mm: Vec<[f32; 2]>,
    /// Index of the tissue; `NONE` for pixels that do not see lit skin.
    pub(crate) tissue: Vec<u16>,
    pub(crate) materials: Arc<[SkinMaterial]>,
}

/// Skin data of the sixteen samples of a mixed pixel. The projector coordinates of these samples are
/// already shifted.
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
    /// Returns the projector pixels per millimetre of skin at a sample, and the index of the
    /// sample's tissue.
    pub(crate) fn at(&self, k: usize) -> ([f32; 2], u16) {
        (self.px_per_mm[k], self.tissue[k])
    }
}

impl SkinMaps {
    /// Returns the projector pixels per millimetre of skin at a pixel, and the index of the pixel's
    /// tissue.
    #[cfg(test)]
    pub(crate) fn at(&self, i: usize) -> ([f32; 2], u16) {
        (self.px_per_mm[i], self.tissue[i])
    }

    /// Returns the spread of the projected light at a pixel along one axis of the pattern image;
    /// `None` if the pixel is not lit skin.
    pub(crate) fn spread(&self, i: usize, axis: usize) -> Option<Spread<'_>> {
        self.of(self.tissue[i], self.px_per_mm[i], axis)
    }

    /// Same as [`Self::spread`], for a sample of a mixed pixel.
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

    /// Returns the fraction of its contrast that a fringe with a period of `period` projector pixels
    /// along an axis keeps on skin.
    pub(crate) fn contrast(&self, i: usize, axis: usize, period: f64) -> f64 {
        self.spread(i, axis).map_or(1.0, |spread| {
            let frequency = f64::from(spread.px_per_mm) / period;
            spread.mixture.transfer(TAU * frequency)
        })
    }
}
