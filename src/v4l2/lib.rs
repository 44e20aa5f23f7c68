//! V4L2 as both halves need it: nodes and what they are, and queues of mapped buffers.
//!
//! Sizes and intervals that a node offers go through the `v4l` crate. The rest does not fit. Its
//! formats and controls panic on what it does not know. Its output stream passes no timestamp and asks for
//! buffers back in an order that v4l2loopback does not keep; its capture stream returns the whole
//! mapping instead of the bytes used, and a timeout leaves it out of step; both panic when they are
//! dropped on a device in trouble: the `queue` of buffers is our own. All `unsafe` code of V4L2 is
//! in this module.

#![cfg(target_os = "linux")]

mod call;
mod control;
mod format;
mod layout;
mod node;
mod queue;

pub use control::{Control, Value as ControlValue, controls};
pub use format::{PixFormat, announce_interval, announced_interval};
pub use layout::{FourCc, PixelLayout, current_format, offered_formats, set_format};
pub use node::{FORGOTTEN, LOOPBACK_DRIVER, Node, RELOAD, lock, node_paths};
pub use queue::{CaptureQueue, OutputQueue, Taken};
