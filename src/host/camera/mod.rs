//! Cameras opened by address (`socket:PATH`, `tcp:HOST:PORT`, `/dev/videoN` or a symbolic link to
//! it under `/dev`), and a camera in memory.
//!
//! Every camera opened here returns GREY or Y16, whatever its own format, without the embedded data
//! line (`intake`). There are two ways to read a V4L2 device (`node`): `v4l` for monochrome cameras,
//! frame by frame as the driver delivers them, and `nokhwa` for the formats of webcams.

mod intake;
#[cfg(all(target_os = "linux", feature = "v4l2"))]
mod node;
#[cfg(not(all(target_os = "linux", feature = "v4l2")))]
#[path = "without_node.rs"]
mod node;
mod open;
mod socket;

pub use intake::Intake;
#[cfg(all(target_os = "linux", feature = "v4l2"))]
pub use node::explain as explain_device;
pub use open::open_camera;
pub use socket::SocketCamera;

use phasmid_core::error::{Error, Result};
use phasmid_protocol::Frame;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// The method by which frames are captured from a V4L2 device.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum CameraDriver {
    /// Chosen by the formats the device offers: `V4l` for GREY, Y10, Y10P, Y12, Y12P and Y16, else
    /// `Nokhwa`.
    #[default]
    Auto,
    /// The V4L2 buffer queue: GREY, Y10, Y10P, Y12, Y12P, Y16 and YUYV, with the driver's
    /// timestamps.
    V4l,
    /// The nokhwa library: YUYV and MJPG, the formats of webcams.
    Nokhwa,
}

/// A source of frames.
pub trait Camera {
    /// Returns the address, for messages.
    fn info(&self) -> &str;

    /// Returns the next frame, or `None` if no complete frame has arrived within the timeout. A
    /// partly received frame is kept for the next call.
    ///
    /// # Errors
    /// Returns an error if the camera is gone, or if it sends an invalid frame.
    fn next_frame(&mut self, timeout: Duration) -> Result<Option<Frame>>;

    /// Returns whether the last call of [`Self::next_frame`] failed only because of a damaged
    /// frame. That frame has been skipped, and the camera continues with the next one.
    fn has_skipped(&self) -> bool {
        false
    }

    /// Returns whether the frames received so far identify themselves, that is, whether their id,
    /// pattern index and times come from the device. Otherwise the id is a running number (a gap is
    /// a frame lost by the driver), the pattern index is missing, and both times are the driver's
    /// timestamp, which most drivers take from the system's monotonic clock.
    fn identifies(&self) -> bool {
        true
    }

    /// Returns whether the camera's device was unplugged but may come back; [`Self::reopen`] waits
    /// for it.
    fn has_gone(&self) -> bool {
        false
    }

    /// Reopens a camera that is gone, at its current address, waiting for it to come back.
    ///
    /// # Errors
    /// Returns an error if the camera does not come back within the timeout, or cannot be reopened.
    fn reopen(&mut self, _timeout: Duration) -> Result<()> {
        Err(Error::device(format!(
            "{}: this camera cannot be opened again",
            self.info()
        )))
    }
}

impl<C: Camera + ?Sized> Camera for Box<C> {
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

/// An in-memory camera: it returns the frames that are put into its queue, and never waits.
#[derive(Debug, Clone, Default)]
pub struct MemoryCamera {
    queue: Arc<Mutex<VecDeque<Frame>>>,
}

impl MemoryCamera {
    /// Puts a frame into the queue.
    pub fn put(&self, frame: Frame) {
        self.queue
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push_back(frame);
    }
}

impl Camera for MemoryCamera {
    fn info(&self) -> &str {
        "memory camera"
    }

    fn next_frame(&mut self, _timeout: Duration) -> Result<Option<Frame>> {
        let mut queue = self.queue.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(queue.pop_front())
    }
}
