//! Image formation: renders the frames of a camera from a profile, a scene and patterns, with
//! ground truth. A device-side crate: it depends on core, shaders (feature `gpu`), geometry, pattern,
//! protocol, phantom and profile, and no host-side crate may depend on it.
//!
//! Rendering has three passes, each skipped when a scene does not need it.
//!
//! 1. `geometry`: once per camera and scene state; computes for each pixel the surface it sees, the
//!    projector coordinate of its light and how much light arrives. `mixed` samples pixels on
//!    edges, `sampled` all pixels; `interreflection` gathers indirect light.
//! 2. `exposure`: per frame; averages the pattern over each pixel's footprint, for the times given by
//!    `schedule`.
//! 3. `sensor`: per frame; electrons, noise, gain, converter.
//!
//! A moving scene is evaluated at several instants of each exposure, or row by row with a rolling
//! shutter: `animation`, `instance` and `worlds` compute its state at those times.
//!
//! The second and third pass run fused over chunks of pixels that stay in cache. [`mod@reference`]
//! is the slow f64 path that the tests compare them with.
//!
//! | module | contents |
//! | --- | --- |
//! | `animation` | object poses and shapes over time |
//! | `aperture` | camera pupil: depth of field |
//! | `buffer` | output maps of the geometry pass |
//! | `exposure` | exposure pass: patterns averaged over footprints |
//! | `geometry` | geometry pass over pixel centres |
//! | `glare` | veiling glare |
//! | `gpu` | the same passes on a GPU (feature `gpu`) |
//! | `gpu_data` | input and reports of the passes on a GPU |
//! | `image_file` | image files as patterns |
//! | `instance` | moving and deforming meshes |
//! | `interreflection` | gathering of indirect light |
//! | `lamps` | lamp light and shadows |
//! | `led` | light source: rise time and thermal droop |
//! | `material` | materials: textures, specular lobe, boards |
//! | `mixed` | sampling of mixed pixels |
//! | `options` | rendering options and backend |
//! | `pattern_image` | a pattern in projector pixels |
//! | `plan` | terms that a scene needs |
//! | `reference` | slow f64 reference path |
//! | `renderer` | the renderer and its pending frames |
//! | `sampled` | sampling of all pixels with several rays |
//! | `schedule` | patterns seen by each part of an exposure |
//! | `sensor` | sensor pass: noise, gain, converter |
//! | `shade` | projector light at surface points |
//! | `shape` | shapes as solids or meshes |
//! | `shot` | parameters of one exposure |
//! | `skin` | subsurface scattering |
//! | `term` | terms of image formation |
//! | `timetable` | pattern timing during an exposure |
//! | `tree` | bounding volume hierarchy in its own frame |
//! | `triangle` | triangle surfaces |
//! | `truth` | ground truth of a frame |
//! | `truth_maps` | ground-truth maps |
//! | `world` | surfaces of a scene at an instant |
//! | `worlds` | surfaces of a scene over an exposure |

// Some items are used only by the GPU passes.
#![cfg_attr(not(feature = "gpu"), allow(dead_code, unused_imports))]

mod animation;
mod aperture;
mod buffer;
mod exposure;
mod geometry;
mod glare;
#[cfg(feature = "gpu")]
pub mod gpu;
#[cfg(not(feature = "gpu"))]
#[path = "without_gpu.rs"]
pub mod gpu;
mod gpu_data;
pub mod image_file;
mod instance;
mod interreflection;
mod lamps;
pub mod led;
mod material;
mod mixed;
pub mod npz;
mod options;
pub mod pattern_image;
mod plan;
pub mod reference;
mod renderer;
mod sampled;
mod schedule;
mod sensor;
mod shade;
mod shape;
pub mod shot;
pub mod skin;
mod term;
mod timetable;
mod tree;
mod triangle;
pub mod truth;
mod truth_files;
mod truth_maps;
mod world;
mod worlds;

pub use gpu::{Adapter, PassTime};
pub use options::{Backend, Options};
pub use plan::{Decision, Plan};
pub use renderer::{IndirectLight, Pending, Renderer};
pub use sensor::read_out;
pub use term::{Pass, Term};
