//! How a device reaches the world: the control port as a pty, the camera as a frame socket and as a
//! V4L2 node, the service channel, the run directory that holds them, the time and the scene that several devices
//! share, and the loop that serves them all.

mod call;
mod frame_socket;
mod history;
mod lateness;
mod optics;
mod pace;
mod pty;
mod readiness;
mod run_dir;
mod server;
mod service;
mod stage;
mod timeline;
pub mod usb;
mod video;

pub use run_dir::RunDir;
pub use server::{Device, UsbLink, serve};
pub use stage::Stage;
pub use timeline::{Seat, Timeline};
pub use video::VideoOutput;
