//! Cameras by address: `socket:PATH`, `tcp:HOST:PORT`, `/dev/videoN` or a link to one under `/dev`.
//!
//! Every camera that is opened here gives GREY or Y16, whatever it speaks, and without the embedded
//! data line (`intake`). Two ways lead to a V4L2 device: `v4l` for mono cameras, frame by
//! frame as the driver has them, and `nokhwa` for what webcams speak.

mod intake;
mod memory;
mod open;
mod socket;
#[cfg(target_os = "linux")]
mod v4l2;
#[cfg(target_os = "linux")]
mod v4l2_error;
#[cfg(target_os = "linux")]
mod webcam;

pub use intake::Intake;
pub use memory::MemoryCamera;
pub use open::{Capture, open_camera};
pub use socket::SocketCamera;
#[cfg(target_os = "linux")]
pub use v4l2_error::explain as explain_device;

use crate::error::Result;
use crate::protocol::Frame;
use std::time::Duration;

/// Where frames come from.
pub trait Camera {
    /// The address, for messages.
    fn info(&self) -> &str;

    /// The next frame, or `None` when none has come whole within the timeout; what has come of one
    /// is kept for the next call.
    ///
    /// # Errors
    /// A camera that has gone or sends what is no frame.
    fn next_frame(&mut self, timeout: Duration) -> Result<Option<Frame>>;

    /// Whether the last call of [`Self::next_frame`] failed for a damaged frame only, which has been
    /// skipped: the camera goes on with the one behind it.
    fn has_skipped(&self) -> bool {
        false
    }

    /// Whether the frames that have come say which they are: id, pattern index and times are the
    /// device's. Otherwise ids only count (a gap is a frame that the driver has lost), there is no
    /// pattern index, and both times are the driver's time of the frame, on the system's monotonic
    /// clock for most drivers.
    fn identifies(&self) -> bool {
        true
    }
}

impl Camera for Box<dyn Camera> {
    fn info(&self) -> &str {
        (**self).info()
    }

    fn next_frame(&mut self, timeout: Duration) -> Result<Option<Frame>> {
        (**self).next_frame(timeout)
    }

    fn has_skipped(&self) -> bool {
        (**self).has_skipped()
    }

    fn identifies(&self) -> bool {
        (**self).identifies()
    }
}
