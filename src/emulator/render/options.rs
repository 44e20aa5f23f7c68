//! What a rendering may spend: the knob of its error against its time.

use crate::error::{Error, Result};

/// What a rendering may spend.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Rays a pixel: 1, 4, 16 or 64. With one, pixels that differ from a neighbour are sampled
    /// (by sixteen), so that what is thinner than a pixel may be missed. With more, every pixel is
    /// looked at by as many, and where they do not see one smooth surface, evenly lit, their mean
    /// counts. Depth of field takes sixteen at least.
    pub samples: u32,
}

impl Default for Options {
    fn default() -> Self {
        Self { samples: 1 }
    }
}

impl Options {
    /// The options, if there is such a rendering.
    ///
    /// # Errors
    /// A number of samples that is not a grid's.
    pub fn checked(self) -> Result<Self> {
        if [1, 4, 16, 64].contains(&self.samples) {
            return Ok(self);
        }
        Err(Error::input(
            "samples",
            self.samples.to_string(),
            "1, 4, 16 or 64",
        ))
    }

    /// Samples on a side of a pixel; with depth of field at least four.
    pub(super) fn side(self, depth_of_field: bool) -> usize {
        let side = self.samples.isqrt() as usize;
        if depth_of_field { side.max(4) } else { side }
    }
}
