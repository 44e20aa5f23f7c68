//! The emulated device: clock, firmware, projector, sensor, ground truth, rendering.

pub mod render;
mod shot;
mod slide;
mod truth;

pub use shot::Shot;
pub use slide::Slide;
pub use truth::Truth;
