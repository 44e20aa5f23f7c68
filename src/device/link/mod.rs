//! How a device reaches the world: the control port as a pty, the camera as a frame socket and as a
//! V4L2 node, the service channel, the run directory that holds them, the time and the scene that
//! several devices share, the loop that serves them all, and the one that serves a recording of them.

mod call;
mod device;
mod frame_socket;
mod history;
mod lateness;
mod optics;
mod pace;
mod pty;
mod readiness;
mod replay;
mod run_dir;
mod server;
mod service;
mod stage;
mod tap;
mod timeline;
pub mod usb;
mod video;

pub use device::{Device, UsbLink, serve};
pub use replay::{Outcome, Replay, replay};
pub use run_dir::RunDir;
pub use stage::Stage;
pub use tap::Recording;
pub use timeline::{Seat, Timeline};
pub use video::VideoOutput;
