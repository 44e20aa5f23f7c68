//! Where frames go: the edge between the device and the links that carry them.

use phasmid_protocol::{Frame, PixelFormat};
use std::collections::VecDeque;
use std::sync::Arc;

/// Takes the frames of a device.
pub trait FrameSink {
    /// Whether somebody reads; a free-running camera exposes for nobody.
    fn attended(&self) -> bool;

    /// Takes a frame; must not block.
    fn put(&mut self, frame: Arc<Frame>);
}

/// What the frames to come have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stream {
    /// Columns.
    pub width: u32,
    /// Rows, the embedded data line among them.
    pub height: u32,
    /// Layout of the pixels.
    pub format: PixelFormat,
    /// Interval of free-running frames in nanoseconds.
    pub interval_ns: u64,
}

impl Stream {
    /// Bytes of a frame.
    pub fn bytes(&self) -> usize {
        self.width as usize * self.height as usize * self.format.bytes_per_pixel()
    }

    /// Whether frames of the two have the same size and layout.
    pub fn same_frames(&self, other: &Self) -> bool {
        let interval_ns = self.interval_ns;
        *self
            == Self {
                interval_ns,
                ..*other
            }
    }

    /// Whether a frame is one of these.
    pub fn carries(&self, frame: &Frame) -> bool {
        (self.width, self.height, self.format) == (frame.width, frame.height, frame.format)
            && frame.data.len() == self.bytes()
    }
}

impl std::fmt::Display for Stream {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let code = self.format.fourcc();
        let code = String::from_utf8_lossy(&code);
        write!(f, "{} {} x {}", code.trim_end(), self.width, self.height)
    }
}

/// A link that has to know what comes before it comes, and may be unable to change.
pub trait StreamSink {
    /// Gets ready for other frames; those that are under way are lost.
    ///
    /// # Errors
    /// Why it cannot; then all is as before.
    fn announce(&mut self, stream: &Stream) -> Result<(), String>;
}

/// Keeps the frames in memory.
#[derive(Debug, Default)]
pub struct MemorySink {
    /// The frames that have come, in order.
    pub frames: VecDeque<Arc<Frame>>,
}

impl FrameSink for MemorySink {
    fn attended(&self) -> bool {
        true
    }

    fn put(&mut self, frame: Arc<Frame>) {
        self.frames.push_back(frame);
    }
}
