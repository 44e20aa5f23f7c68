//! Rendering in three passes, each left out when a scene does not need it.
//!
//! 1. `geometry`: once per camera and state of the scene; what each pixel sees, where on the
//!    slide its light comes from, how much of it arrives. `mixed` samples pixels on edges,
//!    `sampled` all of them; `bounce` gathers what surfaces throw on each other.
//! 2. `light`: per frame; the slide averaged over each pixel's footprint, as long as `schedule` says.
//! 3. `sensor`: per frame; electrons, noise, gain, converter.
//!
//! A scene that moves is looked at anew at several instants of each exposure, or row by row under a
//! rolling shutter: `path`, `body` and `worlds` know where things are then.
//!
//! The second and third run fused over chunks of pixels that stay in cache. [`mod@reference`] is the
//! slow f64 path that the tests hold them against.

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
