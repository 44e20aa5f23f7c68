//! Command ports: bytes to a device and back.

mod line;
mod memory;
mod serial;
#[cfg(all(test, unix))]
mod tests;

pub use memory::MemoryPort;
pub use serial::SerialPort;

use phasmid_core::error::{Error, Result};
use std::time::Duration;

/// A line to a device.
pub trait CommandPort {
    /// The path, for messages.
    fn info(&self) -> &str;

    /// Sends all bytes.
    ///
    /// # Errors
    /// A port that has gone, or one that has not taken all of it within the timeout.
    fn send(&mut self, bytes: &[u8], timeout: Duration) -> Result<()>;

    /// Receives what has come, waiting for the first byte; 0 when none has come in time.
    ///
    /// # Errors
    /// A port that has gone.
    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize>;

    /// Opens the port anew by its address, where the device has gone or was unplugged; waits for it
    /// to come back. What was on its way is forgotten.
    ///
    /// # Errors
    /// A port that does not come back within the timeout, or of a kind that cannot.
    fn reopen(&mut self, _timeout: Duration) -> Result<()> {
        Err(Error::device(format!(
            "{}: this port cannot be opened again",
            self.info()
        )))
    }
}

impl CommandPort for Box<dyn CommandPort> {
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
