//! Rendering options: trade-off between error and time.

use phasmid_core::error::{Error, Result};
use serde::Serialize;

/// Rendering options.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Rays per pixel: 1, 4, 16 or 64. With 1, only pixels that differ from a neighbour are sampled
    /// (with 16 rays), so details thinner than a pixel may be missed. With more, every pixel is
    /// sampled, and the samples' mean is used unless they see one smooth, evenly lit surface. Depth
    /// of field uses at least 16.
    pub samples: u32,
    /// Instants per exposure at which a moving scene is evaluated, 1 to 256. Each costs a geometry
    /// pass; the error of the motion blur falls with the square of their number. If nothing moves
    /// by more than an eighth of a pixel during an exposure, one instant is used.
    pub time_samples: u32,
    /// Error in projector pixels up to which the geometry of a moving scene is interpolated between key
    /// instants instead of traced at each instant; 0 traces at each. Ground truth is always traced.
    pub motion_tolerance_px: f64,
    /// Processor that runs the passes.
    pub backend: Backend,
}

/// Processor that runs the passes. CPU and GPU images differ by f32 rounding, hence occasionally by
/// a grey level; ground truth is always computed on the CPU, in f64.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Backend {
    /// CPU: the same seed gives the same bytes on any machine.
    #[default]
    Cpu,
    /// A Vulkan adapter; a software adapter only if no hardware adapter exists. Rendering fails
    /// without an adapter.
    Gpu,
    /// A hardware Vulkan adapter if there is one that can hold the scene, else the CPU.
    Auto,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            samples: 1,
            time_samples: 4,
            motion_tolerance_px: 0.0,
            backend: Backend::Cpu,
        }
    }
}

impl Options {
    /// Returns the options if they are valid.
    ///
    /// # Errors
    /// Returns an error if the number of samples or instants or the tolerance is not allowed.
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
        let tolerance = self.motion_tolerance_px;
        if !(0.0..=1.0).contains(&tolerance) {
            return Err(Error::input(
                "motion tolerance",
                tolerance.to_string(),
                "0 to 1 projector pixels",
            ));
        }
        Ok(self)
    }

    /// Returns the number of samples along a side of a pixel; with depth of field at least four.
    pub(super) fn side(self, depth_of_field: bool) -> usize {
        let side = self.samples.isqrt() as usize;
        if depth_of_field { side.max(4) } else { side }
    }
}
