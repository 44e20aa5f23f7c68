//! What a rendering may spend: the knob of its error against its time.

use phasmid_core::error::{Error, Result};
use serde::Serialize;

/// What a rendering may spend.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Rays a pixel: 1, 4, 16 or 64. With one, pixels that differ from a neighbour are sampled
    /// (by sixteen), so that what is thinner than a pixel may be missed. With more, every pixel is
    /// looked at by as many, and where they do not see one smooth surface, evenly lit, their mean
    /// counts. Depth of field takes sixteen at least.
    pub samples: u32,
    /// Instants of an exposure at which a scene that moves is looked at, 1 to 256: each costs a
    /// geometry pass, and the error of what they blur falls as the square of their number. A scene
    /// in which nothing goes farther than an eighth of a pixel while an exposure lasts is looked at
    /// once.
    pub time_samples: u32,
    /// What runs the passes.
    pub backend: Backend,
}

/// What runs the passes. Pictures of the two differ by the rounding of f32, and so now and then by a
/// grey level; the truth behind them is always the CPU's, in f64.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Backend {
    /// The processor: the same seed gives the same bytes on any machine.
    #[default]
    Cpu,
    /// A Vulkan adapter, software where there is no other; without one there is no rendering.
    Gpu,
    /// A Vulkan adapter that is hardware, where there is one that holds the scene; else the
    /// processor.
    Auto,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            samples: 1,
            time_samples: 4,
            backend: Backend::Cpu,
        }
    }
}

impl Options {
    /// The options, if there is such a rendering.
    ///
    /// # Errors
    /// A number of samples that is not a grid's, or none or too many instants.
    pub fn checked(self) -> Result<Self> {
        let refuse = |place, found: u32, allowed| {
            let found = found.to_string();
            Err(Error::input(place, found, allowed))
        };
        if ![1, 4, 16, 64].contains(&self.samples) {
            return refuse("samples", self.samples, "1, 4, 16 or 64");
        }
        if !(1..=256).contains(&self.time_samples) {
            return refuse("time samples", self.time_samples, "1 to 256");
        }
        Ok(self)
    }

    /// Samples on a side of a pixel; with depth of field at least four.
    pub(super) fn side(self, depth_of_field: bool) -> usize {
        let side = self.samples.isqrt() as usize;
        if depth_of_field { side.max(4) } else { side }
    }
}
