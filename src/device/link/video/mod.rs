//! The camera as a V4L2 node of the kernel, which every program on the machine can read: frames are
//! written to a node of the v4l2loopback module.
//!
//! Such a node reports neither whether it has readers nor whether a frame was read before it was
//! overwritten. The camera therefore always runs, and frames are written no faster than they were
//! exposed.

mod candidates;
mod open;
mod output;

pub(super) use output::Put;
pub use output::VideoOutput;
