//! The rendering passes on a GPU, through wgpu. The shaders in `shaders/` mirror the CPU code file
//! by file. In comments, "twin of" names the counterpart in the other language, which must be kept
//! equal.
//!
//! | module | contents |
//! | --- | --- |
//! | `device` | selection of an adapter; failures |
//! | `shaders` | assembly of shader sources |
//! | `engine`, `entry_point` | running of shader entry points, specialised by the plan |
//! | `store` | named buffers |
//! | `timing` | pass durations |
//! | `passes` | all passes of one renderer |
//! | `fits` | check whether f32 suffices for a scene |
//! | `scene`, `materials`, `optics` | the scene in shader layout |
//! | `geometry`, `sampled`, `mixed` | geometry pass with its maps: pixel centres, then samples |
//! | `interreflection`, `skin` | indirect light; subsurface scattering |
//! | `exposure`, `tables` | exposure pass, from pattern tables |
//! | `glare` | veiling glare |
//! | `sensor`, `frames` | sensor pass; readback of frames |
//! | `test_scene`, `upload` | CPU maps uploaded to test single passes |

mod device;
mod engine;
mod entry_point;
mod exposure;
#[cfg(test)]
mod exposure_tests;
mod fits;
mod frames;
mod geometry;
mod glare;
mod interreflection;
mod materials;
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
mod store;
mod tables;
#[cfg(test)]
mod tables_tests;
#[cfg(test)]
mod test_scene;
mod timing;
#[cfg(test)]
mod upload;

pub use super::gpu_data::{Adapter, PassTime};
pub(super) use super::gpu_data::{Shown, View};
pub use device::{Gpu, adapters};
pub(super) use engine::{Commands, Engine};
pub(super) use entry_point::{EntryPoint, grid};
pub(super) use fits::fits;
pub(super) use frames::{DEPTH, Ticket};
pub(super) use passes::Passes;
