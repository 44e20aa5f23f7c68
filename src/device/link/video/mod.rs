//! The camera as a node of the kernel's V4L2, which every program on the machine can read: frames go
//! to a node of the v4l2loopback module.
//!
//! Such a node tells neither whether somebody reads, nor whether a frame was read before it was
//! overwritten. So the camera always runs, and frames are handed over no faster than they were
//! exposed.

mod candidates;
mod open;
mod output;

pub use output::VideoOutput;

/// What became of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Put {
    /// It is there for readers.
    Done,
    /// It was exposed before the frames changed: no reader can get it any more.
    Outdated,
    /// The node could not take it.
    Lost,
}
