//! How a device reaches the world: the control port as a pty, the camera as a frame socket and as a
//! V4L2 node, the service channel, the run directory that holds them, and the loop that serves them all.

mod frame_socket;
mod optics;
mod pace;
mod pty;
mod readiness;
mod run_dir;
mod server;
mod service;
pub mod usb;
mod video;

pub use run_dir::RunDir;
pub use server::{Device, UsbLink, serve};
pub use video::VideoOutput;
