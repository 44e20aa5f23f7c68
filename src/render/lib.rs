//! Image formation: renders the frames of a camera from a profile, a scene and patterns, with
//! ground truth. A device-side crate: it depends on core, shaders (feature `gpu`), geometry, pattern,
//! protocol, phantom and profile, and no host-side crate may depend on it.
//!
//! Rendering has three passes; the terms of a pass that a scene does not need are skipped.
//!
//! 1. `transport`: once per camera and scene state; computes for each pixel the surface it sees, the
//!    projector coordinate of its light and how much light arrives. Its `geometry` traces the pixels'
//!    centres, `mixed` samples pixels on edges, `sampled` all pixels; `interreflection` gathers
//!    indirect light.
//! 2. `exposure`: per frame; averages the pattern over each pixel's footprint, for the times given by
//!    `schedule`.
//! 3. `sensor`: per frame; electrons, noise, gain, converter.
//!
//! A moving scene is evaluated at several instants of each exposure, or row by row with a rolling
//! shutter: `scene` computes its state at those times. Its surfaces have the properties in `material`
//! and `skin`.
//!
//! The second and third pass run together over chunks of pixels that stay in cache.
//! [`mod@reference`] is a slow renderer in f64 with which the tests compare the passes.
//!
//! | module | contents |
//! | --- | --- |
//! | `exposure` | exposure pass: patterns averaged over footprints; lamps and lenses |
//! | `glare` | veiling glare |
//! | `gpu` | the same passes on a GPU (feature `gpu`) |
//! | `gpu_data` | input and reports of the passes on a GPU |
//! | `image_file` | image files as patterns |
//! | `led` | light source: rise time and thermal droop |
//! | `material` | materials: textures, specular lobe, boards |
//! | `options` | rendering options and backend |
//! | `pattern_image` | a pattern in projector pixels |
//! | `plan` | terms that a scene needs |
//! | `reference` | slow f64 reference path |
//! | `renderer` | the renderer and its pending frames |
//! | `scene` | surfaces of a scene at an instant and over an exposure |
//! | `schedule` | patterns seen by each part of an exposure |
//! | `sensor` | sensor pass: noise, gain, converter |
//! | `shot` | parameters of one exposure |
//! | `skin` | subsurface scattering |
//! | `term` | terms of image formation, and sets of them |
//! | `timetable` | pattern timing during an exposure |
//! | `transport` | geometry pass: rays, reflection, interreflection |
//! | `truth` | ground truth of a frame |
//! | `truth_maps` | ground-truth maps |

// Some items are used only by the GPU passes.
#![cfg_attr(not(feature = "gpu"), allow(dead_code, unused_imports))]

mod exposure;
mod glare;
#[cfg(feature = "gpu")]
pub mod gpu;
#[cfg(not(feature = "gpu"))]
#[path = "without_gpu.rs"]
pub mod gpu;
mod gpu_data;
pub mod image_file;
pub mod led;
mod material;
pub mod npz;
mod options;
pub mod pattern_image;
mod plan;
pub mod reference;
mod renderer;
mod scene;
mod schedule;
mod sensor;
pub mod shot;
pub mod skin;
mod term;
mod timetable;
mod transport;
pub mod truth;
mod truth_files;
mod truth_maps;

pub use gpu::{Adapter, PassTime};
pub use options::{Backend, Options};
pub use plan::Decision;
pub use renderer::{IndirectLight, Interpolation, Pending, Renderer};
pub use sensor::read_out;
pub use term::{Pass, Plan, Term};
