//! The rendering passes on a GPU, through wgpu: the shaders in `shaders/` are twins of the CPU
//! passes, with the same names and order.
//!
//! `device` finds an adapter; `shaders` assembles the sources; `engine` runs them on named buffers
//! (`store`), specialised by the plan (`stage`), and times them (`timing`). `exposure` computes the
//! light from pattern `tables`; `glare` scatters it.

mod aperture;
#[cfg(test)]
mod bench;
mod bounce;
mod device;
mod engine;
mod exposure;
#[cfg(test)]
mod exposure_tests;
mod fits;
mod frames;
mod geometry;
mod glare;
mod looks;
mod maps;
mod mixed;
mod optics;
mod passes;
mod sampled;
mod scene;
mod sensor;
#[cfg(test)]
mod sensor_tests;
mod shaders;
mod skin;
mod stage;
mod store;
mod tables;
#[cfg(test)]
mod tables_tests;
mod timing;
#[cfg(test)]
mod upload;
#[cfg(test)]
mod upload_mixed;

pub use device::{Adapter, Gpu, adapters};
pub(super) use engine::{Commands, Engine};
pub(super) use exposure::Shown;
pub(super) use fits::fits;
pub(super) use frames::{DEPTH, Ticket};
pub(super) use passes::{Passes, View};
pub(super) use stage::{Stage, grid};
pub use timing::PassTime;
