//! Command ports: byte streams to and from a device.

mod line;
mod memory;
mod serial;
#[cfg(all(test, unix))]
mod tests;

pub use memory::MemoryPort;
pub use serial::SerialPort;

use phasmid_core::error::{Error, Result};
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

    /// Receives the available bytes, waiting for the first one; returns 0 if none comes within the
    /// timeout.
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
