//! Image formation: renders the frames of a camera from a profile, a scene and patterns, with
//! ground truth. A device-side crate: it depends on core, shaders, geometry, pattern, protocol,
//! phantom and profile, and no host-side crate may depend on it.
//!
//! Rendering has three passes, each skipped when a scene does not need it.
//!
//! 1. `geometry`: once per camera and scene state; computes for each pixel the surface it sees, the
//!    projector coordinate of its light and how much light arrives. `mixed` samples pixels on
//!    edges, `sampled` all pixels; `bounce` gathers indirect light.
//! 2. `light`: per frame; averages the pattern over each pixel's footprint, for the times given by
//!    `schedule`.
//! 3. `sensor`: per frame; electrons, noise, gain, converter.
//!
//! A moving scene is evaluated at several instants of each exposure, or row by row with a rolling
//! shutter: `path`, `body` and `worlds` compute its state at those times.
//!
//! The second and third pass run fused over chunks of pixels that stay in cache. [`mod@reference`]
//! is the slow f64 path that the tests compare them with.
//!
//! | module | contents |
//! | --- | --- |
//! | `aperture` | camera pupil: depth of field |
//! | `body` | moving and deforming meshes |
//! | `bounce` | interreflection: gathering of indirect light |
//! | `buffer` | output maps of the geometry pass |
//! | `geometry` | geometry pass over pixel centres |
//! | `glare` | veiling glare |
//! | `gpu` | the same passes on a GPU |
//! | `lamps` | lamp light and shadows |
//! | `led` | light source: rise time and thermal droop |
//! | `light` | exposure pass: patterns averaged over footprints |
//! | `look` | materials: textures, specular lobe, boards |
//! | `mixed` | sampling of mixed pixels |
//! | `options` | rendering options and backend |
//! | `path` | object poses and shapes over time |
//! | `picture` | image files |
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
//! | `slide` | projected pattern |
//! | `term` | terms of image formation |
//! | `timetable` | pattern timing during an exposure |
//! | `tree` | bounding volume hierarchy in its own frame |
//! | `triangle` | triangle surfaces |
//! | `truth` | ground truth of a frame |
//! | `truth_maps` | ground-truth maps |
//! | `world` | surfaces of a scene at an instant |
//! | `worlds` | surfaces of a scene over an exposure |

mod aperture;
mod body;
mod bounce;
mod buffer;
mod geometry;
mod glare;
pub mod gpu;
mod lamps;
pub mod led;
mod light;
mod look;
mod mixed;
mod options;
mod path;
pub mod picture;
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
pub mod slide;
mod term;
mod timetable;
mod tree;
mod triangle;
pub mod truth;
mod truth_maps;
mod world;
mod worlds;

pub use gpu::{Adapter, PassTime};
pub use options::{Backend, Options};
pub use plan::{Decision, Plan};
pub use renderer::{Pending, Renderer};
pub use sensor::read_out;
pub use term::{Pass, Term};
