//! V4L2 as both halves need it: nodes and what they are, and queues of mapped buffers.
//!
//! Formats, intervals and controls go through the `v4l` crate. Its streams do not fit, so the queue
//! of buffers is [`queue`]'s own: an output stream passes no timestamp and asks for buffers back in
//! an order that v4l2loopback does not keep, a capture stream returns the whole mapping instead of
//! the bytes used, a timeout leaves it out of step, and both panic when they are dropped on a
//! device in trouble. All `unsafe` code of V4L2 is in [`queue`] and its [`call`].

mod call;
mod node;
mod queue;

pub use node::{LOOPBACK_DRIVER, Node, node_paths};
pub use queue::{CaptureQueue, OutputQueue, Taken};
