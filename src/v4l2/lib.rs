//! V4L2 access shared by device and host: nodes, their formats and controls, and queues of
//! memory-mapped buffers. Depends on no device-side or host-side crate. Contains all `unsafe` code
//! for V4L2.
//!
//! | module | contents |
//! | --- | --- |
//! | `call` | one ioctl with a typed argument |
//! | `control` | the controls of a node |
//! | `format` | format and frame interval of a node |
//! | `layout` | current and offered formats of a capture node |
//! | `node` | device nodes and their capabilities |
//! | `queue` | capture and output queues of mapped buffers |
//!
//! Through the `v4l` crate, only the frame sizes and intervals that a node offers are read. That
//! crate's formats and controls panic on unknown values. Its output stream passes no timestamp and
//! dequeues buffers in an order that v4l2loopback does not keep. Its capture stream returns the
//! whole mapping instead of the used bytes, and is out of step after a timeout. Both streams panic
//! when they are dropped on a failed device. This crate therefore has its own `queue`.

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
