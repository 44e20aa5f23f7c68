//! The passes on a GPU, through wgpu: the shaders in `shaders/` are their twins, by name and order.
//!
//! `device` finds an adapter; `shaders` holds the sources and puts them together; `engine` runs them
//! over named buffers (`store`), specialised by the plan (`stage`), and times them (`timing`).
//! `exposure` is light, its slides in `tables`; `glare` spreads it.

mod device;
mod engine;
mod exposure;
#[cfg(test)]
mod exposure_tests;
mod glare;
mod shaders;
mod stage;
mod store;
mod tables;
#[cfg(test)]
mod tables_tests;
mod timing;
mod upload;
mod upload_mixed;

pub use device::{Adapter, Gpu, adapters};
pub(super) use engine::Engine;
pub(super) use stage::{Stage, grid};
