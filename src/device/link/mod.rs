//! Links between a device and its clients: the control port as a pty, the camera as a frame socket,
//! V4L2 node or USB device, the service channel, the run directory that holds them, the timeline
//! and scene that several devices share, and the event loops that serve devices and replay
//! recordings. [`Notice`] receives their messages for a device's operator.

mod call;
mod device;
mod frame_socket;
mod history;
mod lateness;
mod pace;
mod pty;
mod readiness;
mod render_thread;
mod replay;
mod run_dir;
mod server;
mod service;
mod serving;
mod shared_scene;
mod slowdown;
mod tap;
mod timeline;
pub mod usb;
#[cfg(feature = "v4l2")]
mod video;
#[cfg(not(feature = "v4l2"))]
#[path = "without_video.rs"]
mod video;

pub use device::{ServedDevice, serve};
pub use frame_socket::Tcp;
pub use replay::{Outcome, Replay, replay};
pub use run_dir::RunDir;
pub use serving::{CameraNode, RecordingFile, ServeOptions, Serving, monotonic};
pub use shared_scene::SharedScene;
pub use tap::Recording;
pub use timeline::{Seat, Timeline};
pub use usb::export::{UsbLink, UsbServing};
pub use video::VideoOutput;

use std::fmt;
use std::sync::Arc;

/// Receives messages for the operator of a device, from any of the device's threads. The default
/// value ignores all messages.
#[derive(Clone)]
pub struct Notice(Arc<dyn Fn(&str) + Send + Sync>);

impl Notice {
    /// Returns a notice that passes messages to a function.
    pub fn new(told: impl Fn(&str) + Send + Sync + 'static) -> Self {
        Self(Arc::new(told))
    }

    fn tell(&self, message: &str) {
        (self.0)(message);
    }
}

impl Default for Notice {
    fn default() -> Self {
        Self::new(|_| {})
    }
}

impl fmt::Debug for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Notice")
    }
}
