//! What goes wrong on a bad day: wrappers around the ways into the device and out of it.

use super::Exposure;
use super::port::Message;
use crate::protocol::Frame;
use std::collections::VecDeque;
use std::sync::Arc;

/// Everything that goes wrong with one device.
#[derive(Debug, Default)]
pub struct Faults {
    replies: VecDeque<Vec<u8>>,
    frames: VecDeque<Arc<Frame>>,
}

impl Faults {
    /// Bytes on their way to the device.
    pub fn incoming(&mut self, bytes: Vec<u8>, _now_ns: u64) -> Vec<u8> {
        bytes
    }

    /// A message on its way to the client.
    pub fn reply(&mut self, message: Message, _now_ns: u64) {
        self.replies.push_back(message.bytes);
    }

    /// What goes out on the line by now.
    pub fn replies(&mut self, _now_ns: u64) -> Vec<Vec<u8>> {
        self.replies.drain(..).collect()
    }

    /// Exposures on their way to the optics. As many come out as went in.
    pub fn exposures(&mut self, exposures: Vec<Exposure>, _now_ns: u64) -> Vec<Exposure> {
        exposures
    }

    /// A frame on its way out.
    pub fn frame(&mut self, frame: Arc<Frame>, _now_ns: u64) {
        self.frames.push_back(frame);
    }

    /// Frames that leave by now.
    pub fn frames(&mut self, _now_ns: u64) -> Vec<Arc<Frame>> {
        self.frames.drain(..).collect()
    }

    /// When something that was held back goes on.
    pub fn next_event_ns(&self) -> Option<u64> {
        None
    }

    /// The client has gone, and what was on its way to it with it.
    pub fn hang_up(&mut self) {
        self.replies.clear();
    }
}
