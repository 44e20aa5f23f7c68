//! Command ports: byte streams to and from a device, such as a serial port or a port in memory.

mod line;
mod serial;
#[cfg(all(test, unix))]
mod tests;

pub use serial::SerialPort;

use phasmid_core::error::{Error, Result};
use std::collections::VecDeque;
use std::io::Read;
use std::time::Duration;

/// A byte stream to and from a device.
pub trait CommandPort {
    /// Returns the path, for messages.
    fn info(&self) -> &str;

    /// Sends all bytes.
    ///
    /// # Errors
    /// Returns an error if the port is gone, or has not accepted all bytes within the timeout.
    fn send(&mut self, bytes: &[u8], timeout: Duration) -> Result<()>;

    /// Receives the available bytes after waiting for the first one; returns 0 if no byte comes
    /// within the timeout.
    ///
    /// # Errors
    /// Returns an error if the port is gone.
    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize>;

    /// Reopens the port by its address after the device was lost or unplugged, waiting for it to
    /// come back. Data in transit is dropped.
    ///
    /// # Errors
    /// Returns an error if the port does not come back within the timeout, or cannot be reopened.
    fn reopen(&mut self, _timeout: Duration) -> Result<()> {
        Err(Error::device(format!(
            "{}: this port cannot be opened again",
            self.info()
        )))
    }
}

impl<P: CommandPort + ?Sized> CommandPort for Box<P> {
    fn info(&self) -> &str {
        (**self).info()
    }

    fn send(&mut self, bytes: &[u8], timeout: Duration) -> Result<()> {
        (**self).send(bytes, timeout)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize> {
        (**self).receive(buffer, timeout)
    }

    fn reopen(&mut self, timeout: Duration) -> Result<()> {
        (**self).reopen(timeout)
    }
}

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
