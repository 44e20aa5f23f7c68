//! An in-memory camera.

use super::Camera;
use phasmid_core::error::Result;
use phasmid_protocol::Frame;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

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
