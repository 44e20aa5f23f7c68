//! Decodes frames to projector coordinates and points, with a standard deviation per pixel. This crate
//! depends on `phasmid-core`, `phasmid-geometry` and `phasmid-pattern` only and is independent of where
//! frames come from.
//!
//! [`Plan`] reads a sequence manifest and states how its axes can be decoded, or what is missing.
//! [`Decoder`] holds the tables and buffers for one plan, image size and rig, and turns
//! [`Image`](phasmid_pattern::Image)s into [`Decoded`] maps in passes over rows. Each pass is parallel
//! and gives the same result on any number of threads:
//!
//! 1. least squares over the steps of every fringe set ([`FringeSet`]), Gray bits ([`GrayCode`]), the
//!    fringe order with a test of its certainty, and one standard deviation per pixel. A pixel is
//!    rejected as damaged in one of its frames if its steps, or the means of its sets, contradict each
//!    other by more than is usual in the capture (`robust_scale`), or if a Gray bit contradicts the
//!    phase; it is also rejected if its Gray bits come from two places at once, as at a silhouette
//!    (`order`);
//! 2. mixed pixels and outliers that lie on neither side's extrapolation (`edges`), then pixels that
//!    border on a step or a hole (`borders`);
//! 3. correction of the error due to held projector pixels (`held`);
//! 4. triangulation, if there is a rig ([`crate::triangulate::Triangulator`]).
//!
//! [`check_sequence`] judges whether frames are those of their sequence (`consistency`).

mod borders;
mod capture;
mod cloud;
mod consistency;
mod decoder;
pub mod deviation;
mod edges;
mod gray;
mod held;
mod load;
mod loss;
mod maps;
mod noise;
mod options;
mod order;
mod output;
mod phase;
mod plan;
mod robust_scale;
mod rows;
mod sample;
mod sparse;
mod steps;
pub mod triangulate;
mod turns;
mod unresolved;
mod unwrap;
mod weighted;

pub use capture::{CALIBRATION_FILE, Capture, FrameInfo, MANIFEST_FILE, write_png};
pub use consistency::{FrameDoubt, Known, check_modulation, check_sequence, doubt_of_fringes};
pub use decoder::Decoder;
pub use gray::{GrayBit, GrayCode};
pub use held::Held;
pub use load::{frame_size, load_frames};
pub use maps::{AxisMap, Decoded, Verdict};
pub use noise::estimate_noise;
pub use options::Options;
pub use output::{Summary, output_names, write_outputs};
pub use phase::MODEL_ERROR;
pub use plan::{AxisPlan, Order, Plan};
pub use sparse::SparseDecoder;
pub use steps::FringeSet;
