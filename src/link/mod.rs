//! How a device reaches the world: the control port as a pty, the camera as a frame socket and as a
//! V4L2 node, the service channel, the run directory that holds them, the loop
//! that serves them all, and the one that serves a recording of them.

mod frame_socket;
mod optics;
mod pace;
mod pty;
mod readiness;
mod replay;
mod run_dir;
mod server;
mod service;
mod tap;
pub mod usb;
mod video;

pub use replay::{Outcome, Replay, replay};
pub use run_dir::RunDir;
pub use server::{Device, UsbLink, serve};
pub use tap::Recording;
pub use video::VideoOutput;
