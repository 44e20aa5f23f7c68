//! Frames to projector coordinates to points.
//!
//! [`Plan`] reads a sequence manifest and says how its axes can be decoded, or what is missing.
//! [`Decoder`] holds the tables and buffers of one plan, image size and rig, and turns a
//! [`FrameStack`] into [`Decoded`] maps in three passes over rows, each parallel and with the same
//! result on any number of threads:
//!
//! 1. least squares over the steps of every fringe set ([`FringeSet`]), Gray bits ([`GrayCode`]),
//!    the period's order with a test whether it is certain, one standard deviation per pixel; a
//!    pixel whose steps, or the means of whose sets, contradict each other by more than is usual in the
//!    capture (`usual`), or a Gray bit of which contradicts the phase, is refused, for one of its frames is damaged there; so is
//!    one whose Gray bits are those of two places at once, as at a silhouette (`order`);
//! 2. mixed pixels and stray errors, which lie on neither side's extrapolation (`edges`), then the
//!    pixels that border on a step or a hole (`borders`);
//! 3. triangulation, where there is a rig ([`crate::triangulate::Triangulator`]).
//!
//! The decoder knows nothing of where frames come from.

mod borders;
mod cloud;
mod decoder;
pub mod deviation;
mod doubt;
mod edges;
mod gray;
mod load;
mod maps;
mod noise;
mod npy;
mod order;
mod output;
mod phase;
mod plan;
mod rows;
mod samples;
mod sparse;
mod steps;
pub mod triangulate;
mod turns;
mod unwrap;
mod usual;
mod weighted;

pub use decoder::{Decoder, Options};
pub use gray::{GrayBit, GrayCode};
pub use load::{LoadedFrames, frame_size, load_frames};
pub use maps::{AxisMap, Decoded, Verdict};
pub use noise::estimate_noise;
pub use npy::write_npy;
pub use output::{Summary, output_names, write_outputs};
pub use plan::{AxisPlan, Order, Plan};
pub use samples::{FrameStack, Samples};
pub use sparse::SparseDecoder;
pub use steps::FringeSet;
