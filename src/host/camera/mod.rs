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
mod unplugged;
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

use phasmid_core::error::{Error, Result};
use phasmid_protocol::Frame;
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

    /// Whether the camera has gone and may come back: its device was unplugged, and
    /// [`Self::reopen`] waits for it.
    fn has_gone(&self) -> bool {
        false
    }

    /// Opens a camera anew that has gone, by whatever address it has now; waits for it to come back.
    ///
    /// # Errors
    /// A camera that does not come back within the timeout, or of a kind that cannot.
    fn reopen(&mut self, _timeout: Duration) -> Result<()> {
        Err(Error::device(format!(
            "{}: this camera cannot be opened again",
            self.info()
        )))
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
    fn has_gone(&self) -> bool {
        (**self).has_gone()
    }

    fn reopen(&mut self, timeout: Duration) -> Result<()> {
        (**self).reopen(timeout)
    }
}
