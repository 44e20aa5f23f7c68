//! The passes on a GPU, through wgpu: the shaders in `shaders/` are their twins, by name and order.
//!
//! `device` finds an adapter; `shaders` holds the sources and puts them together; `engine` runs them
//! over named buffers (`store`), specialised by the plan (`stage`), and times them (`timing`).

mod aperture;
mod device;
mod engine;
mod frames;
mod geometry;
mod looks;
mod mixed;
mod optics;
mod passes;
mod sampled;
mod scene;
mod sensor;
#[cfg(test)]
mod sensor_tests;
mod shaders;
mod stage;
mod store;
mod timing;
mod upload;

pub use device::{Adapter, Gpu, adapters};
pub(super) use engine::{Commands, Engine};
pub(super) use frames::{DEPTH, Ticket};
pub(super) use passes::Passes;
pub(super) use stage::{Stage, grid};
pub use timing::PassTime;
