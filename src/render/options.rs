//! Rendering options: trade-off between error and render time.

use phasmid_core::error::{Error, Result};
use serde::Serialize;

/// Rendering options.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Number of rays per pixel: 1, 4, 16 or 64. With 1, only pixels that differ from a neighbour
    /// are sampled (with 16 rays), so details thinner than a pixel may be missed. With more, every
    /// pixel is sampled; the mean of its samples is used unless they all see one smooth, evenly lit
    /// surface. Depth of field uses at least 16 rays.
    pub samples: u32,
    /// Number of instants per exposure at which a moving scene is evaluated, 1 to 256. Each instant
    /// costs a geometry pass; the error of the motion blur falls with the square of the number of
    /// instants. If nothing moves by more than an eighth of a pixel during an exposure, one instant
    /// is used.
    pub time_samples: u32,
    /// Maximum error in projector pixels with which the geometry of a moving scene may be
    /// interpolated between key instants instead of traced at each instant; 0.01 by default. With 0, it
    /// is traced at each instant. Ground truth is always traced.
    pub motion_tolerance_px: f64,
    /// Processor that runs the passes.
    pub backend: Backend,
}

/// Processor that runs the passes. The images of CPU and GPU differ by f32 rounding and therefore
/// occasionally by a grey level. Only the CPU interpolates the geometry of moving scenes
/// ([`Options::motion_tolerance_px`]). Ground truth is always computed on the CPU, in f64.
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
            motion_tolerance_px: 0.01,
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

    /// Returns the number of samples along a side of a pixel, which is at least four with depth of
    /// field.
    pub(super) fn side(self, depth_of_field: bool) -> usize {
        let side = self.samples.isqrt() as usize;
        if depth_of_field { side.max(4) } else { side }
    }
}
