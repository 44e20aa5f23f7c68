//! An in-memory port.

use super::CommandPort;
use phasmid_core::error::{Error, Result};
use std::collections::VecDeque;
use std::io::Read;
use std::time::Duration;

/// An in-memory port: a function acts as the device and returns what the device sends back.
pub struct MemoryPort<F> {
    device: F,
    replies: VecDeque<u8>,
}

impl<F: FnMut(&[u8]) -> Vec<u8>> MemoryPort<F> {
    /// Creates a port to a device that is a function.
    pub fn new(device: F) -> Self {
        Self {
            device,
            replies: VecDeque::new(),
        }
    }
}

impl<F: FnMut(&[u8]) -> Vec<u8>> CommandPort for MemoryPort<F> {
    fn info(&self) -> &str {
        "memory port"
    }

    fn send(&mut self, bytes: &[u8], _timeout: Duration) -> Result<()> {
        self.replies.extend((self.device)(bytes));
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], _timeout: Duration) -> Result<usize> {
        self.replies
            .read(buffer)
            .map_err(|e| Error::io("memory port", e))
    }

    fn reopen(&mut self, _timeout: Duration) -> Result<()> {
        self.replies.clear();
        Ok(())
    }
}
