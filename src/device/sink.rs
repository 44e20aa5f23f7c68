//! Receivers of frames: the interface between the device and the links.

use phasmid_core::error::Result;
use phasmid_protocol::{Frame, PixelFormat};
use std::collections::VecDeque;
use std::sync::Arc;

/// Receives the frames of a device.
pub trait FrameSink {
    /// Returns whether a client reads frames. A free-running camera exposes only if one does.
    fn attended(&self) -> bool;

    /// Receives a frame; must not block.
    fn put(&mut self, frame: Arc<Frame>);
}

/// Format of the frames that follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stream {
    /// Columns.
    pub width: u32,
    /// Rows, including the embedded data line.
    pub height: u32,
    /// Layout of the pixels.
    pub format: PixelFormat,
    /// Interval of free-running frames in nanoseconds.
    pub interval_ns: u64,
}

impl Stream {
    /// Size of a frame in bytes.
    pub fn bytes(&self) -> usize {
        self.format.frame_bytes(self.width, self.height)
    }

    /// Returns whether frames of both streams have the same size and layout.
    pub fn same_frames(&self, other: &Self) -> bool {
        let interval_ns = self.interval_ns;
        *self
            == Self {
                interval_ns,
                ..*other
            }
    }

    /// Returns whether a frame belongs to this stream.
    pub fn carries(&self, frame: &Frame) -> bool {
        (self.width, self.height, self.format) == (frame.width, frame.height, frame.format)
            && frame.data.len() == self.bytes()
    }
}

impl std::fmt::Display for Stream {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {} x {}", self.format.name(), self.width, self.height)
    }
}

/// A link that must know the stream format in advance and may be unable to change to another.
pub trait StreamSink {
    /// Prepares for a new format; frames in progress are lost.
    ///
    /// # Errors
    /// Returns an error with the reason if the link cannot change to the new format and keeps the
    /// old one.
    fn announce(&mut self, stream: &Stream) -> Result<()>;
}

/// Keeps the received frames in memory.
#[derive(Debug, Default)]
pub struct MemorySink {
    /// The received frames, in order.
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
