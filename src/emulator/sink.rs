//! Where frames go: the edge between the device and the links that carry them.

use crate::protocol::Frame;
use std::collections::VecDeque;
use std::sync::Arc;

/// Takes the frames of a device.
pub trait FrameSink {
    /// Whether somebody reads; a free-running camera exposes for nobody.
    fn attended(&self) -> bool;

    /// Takes a frame; must not block.
    fn put(&mut self, frame: Arc<Frame>);
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
