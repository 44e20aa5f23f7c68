//! Command ports: bytes to a device and back.

use crate::error::{Error, Result};
use serialport::ClearBuffer;
use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::time::{Duration, Instant};

/// How often to look whether a port has come back.
const LOOK_AGAIN: Duration = Duration::from_millis(20);
/// Ignored by ptys and USB; a device on a real line is expected at this rate.
const BAUD_RATE: u32 = 115_200;

/// A line to a device.
pub trait CommandPort {
    /// The path, for messages.
    fn info(&self) -> &str;

    /// Sends all bytes.
    ///
    /// # Errors
    /// A port that has gone, or one that takes nothing within the timeout.
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

/// A serial port, a pty among them, by its path.
pub struct SerialPort {
    /// `None` while it is being opened again.
    port: Option<Box<dyn serialport::SerialPort>>,
    path: String,
}

impl SerialPort {
    /// Opens a port exclusively, and forgets what was waiting on it.
    ///
    /// # Errors
    /// A path where no serial port is, or one that somebody else has open.
    pub fn open(path: &str) -> Result<Self> {
        let place = format!("--control {path}");
        let failed = |e: serialport::Error| match e.kind() {
            serialport::ErrorKind::Io(ErrorKind::NotFound) => {
                Error::input(&place, "no such file", "the path of a serial port")
            }
            // Their words for ENOTTY and EISDIR, for which the library has no kind.
            serialport::ErrorKind::Unknown
                if ["Not a typewriter", "Is a directory"].contains(&e.description.as_str()) =>
            {
                Error::input(&place, "no serial port", "the path of a serial port")
            }
            serialport::ErrorKind::Io(kind) => Error::io(&place, kind.into()),
            _ => Error::device(format!("{place}: {e}")),
        };
        // Elsewhere a port is a name and no file.
        if cfg!(unix)
            && let Err(e) = std::fs::symlink_metadata(path)
        {
            return Err(match e.kind() {
                ErrorKind::NotFound | ErrorKind::NotADirectory => {
                    Error::input(place, "no such file", "the path of a serial port")
                }
                _ => Error::io(place, e),
            });
        }
        let port = serialport::new(path, BAUD_RATE).open().map_err(failed)?;
        port.clear(ClearBuffer::Input).map_err(failed)?;
        Ok(Self {
            port: Some(port),
            path: path.to_owned(),
        })
    }

    /// The port, with a timeout.
    fn waiting(&mut self, timeout: Duration) -> Result<&mut Box<dyn serialport::SerialPort>> {
        let gone = || Error::device(format!("{}: the device has gone", self.path));
        let port = self.port.as_mut().ok_or_else(gone)?;
        let set = port.set_timeout(timeout);
        set.map_err(|e| Error::io(&self.path, e.into()))?;
        Ok(port)
    }
}

impl CommandPort for SerialPort {
    fn info(&self) -> &str {
        &self.path
    }

    fn send(&mut self, bytes: &[u8], timeout: Duration) -> Result<()> {
        let written = self.waiting(timeout)?.write_all(bytes);
        written.map_err(|e| match e.kind() {
            ErrorKind::TimedOut => Error::device(format!(
                "{}: the device has taken nothing for {} s",
                self.path,
                timeout.as_secs_f64()
            )),
            _ => Error::io(&self.path, e),
        })
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize> {
        loop {
            match self.waiting(timeout)?.read(buffer) {
                Ok(0) => {
                    return Err(Error::device(format!("{}: the device has gone", self.path)));
                }
                Ok(len) => return Ok(len),
                Err(e) if e.kind() == ErrorKind::TimedOut => return Ok(0),
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return Err(Error::io(&self.path, e)),
            }
        }
    }

    fn reopen(&mut self, timeout: Duration) -> Result<()> {
        let begin = Instant::now();
        // The lock is this one's own, and an adapter that comes back would get another name.
        self.port = None;
        loop {
            match Self::open(&self.path) {
                Ok(back) => {
                    *self = back;
                    return Ok(());
                }
                // The name may be gone, or lead nowhere yet.
                Err(error) if begin.elapsed() >= timeout => {
                    return Err(Error::device(format!(
                        "the device has gone and has not come back within {} s: {error}",
                        timeout.as_secs_f64()
                    )));
                }
                Err(_) => std::thread::sleep(LOOK_AGAIN),
            }
        }
    }
}

/// A port in memory: a function stands for the device and gives what it sends back.
pub struct MemoryPort<F> {
    device: F,
    replies: VecDeque<u8>,
}

impl<F: FnMut(&[u8]) -> Vec<u8>> MemoryPort<F> {
    /// A line to a device that is a function.
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

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_serial_port_is_the_user_s_mistake() {
        for (path, found) in [
            ("/dev/null", "no serial port"),
            ("/dev", "no serial port"),
            ("/dev/no-such-port", "no such file"),
            ("/dev/null/port", "no such file"),
        ] {
            let error = SerialPort::open(path).err().unwrap();
            assert_eq!(error.exit_code(), 2, "{error}");
            assert!(error.to_string().contains(found), "{error}");
        }
    }

    #[test]
    fn another_refusal_keeps_the_system_s_words() {
        // A name that is too long, for want of a folder that root may not enter.
        let error = SerialPort::open(&"x".repeat(5000)).err().unwrap();
        assert_eq!(error.exit_code(), 1, "{error}");
        assert!(error.to_string().contains("too long"), "{error}");
    }
}
