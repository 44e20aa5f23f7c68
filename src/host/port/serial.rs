//! A serial port, opened by its path. If a USB device provides the port, it is reopened at the path
//! that this device has then.

use super::CommandPort;
use super::line::Line;
use crate::plug::Plug;
use crate::time::again;
use phasmid_core::error::{Error, Result};
use std::io::ErrorKind;
use std::time::Duration;

/// A serial port, or a pty, opened by its path.
pub struct SerialPort {
    /// `None` while the port is being reopened.
    line: Option<Line>,
    path: String,
    /// The path as given.
    given: String,
    /// The USB device that provides this port; `None` if it is not a USB port.
    plug: Option<Plug>,
}

impl SerialPort {
    /// Opens a port exclusively and discards data waiting on it.
    ///
    /// # Errors
    /// Returns an error if the path is not a serial port, or if another program has it open.
    pub fn open(path: &str) -> Result<Self> {
        let place = format!("--control {path}");
        let line = Line::open(path).map_err(|e| match e.kind() {
            ErrorKind::NotFound | ErrorKind::NotADirectory => {
                Error::input(&place, "no such file", "the path of a serial port")
            }
            ErrorKind::IsADirectory | ErrorKind::InvalidInput => {
                Error::input(&place, "no serial port", "the path of a serial port")
            }
            ErrorKind::ResourceBusy => {
                Error::device(format!("{place}: another program has the port open"))
            }
            _ => Error::io(&place, e),
        })?;
        Ok(Self {
            line: Some(line),
            path: path.to_owned(),
            given: path.to_owned(),
            plug: Plug::of("tty", path),
        })
    }

    /// Reopens the port at the path that the port's USB device has now, or else at the given path.
    fn find(&mut self) -> Result<()> {
        let path = match &self.plug {
            None => self.given.clone(),
            Some(plug) => plug.path(&self.given)?,
        };
        self.line = Self::open(&path)?.line;
        self.path = path;
        Ok(())
    }

    fn gone(&self) -> Error {
        Error::device(format!("{}: the device disconnected", self.path))
    }
}

impl CommandPort for SerialPort {
    fn info(&self) -> &str {
        &self.path
    }

    fn send(&mut self, bytes: &[u8], timeout: Duration) -> Result<()> {
        let Some(line) = &mut self.line else {
            return Err(self.gone());
        };
        let taken = line.write(bytes, timeout);
        let taken = taken.map_err(|e| Error::io(&self.path, e))?;
        if taken == bytes.len() {
            return Ok(());
        }
        let what = match taken {
            0 => "no data".to_owned(),
            some => format!("only {some} of {} bytes", bytes.len()),
        };
        Err(Error::device(format!(
            "{}: the device has accepted {what} in {} s",
            self.path,
            timeout.as_secs_f64()
        )))
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize> {
        let Some(line) = &mut self.line else {
            return Err(self.gone());
        };
        match line.read(buffer, timeout) {
            Ok(Some(0)) => Err(self.gone()),
            Ok(len) => Ok(len.unwrap_or(0)),
            Err(e) => Err(Error::io(&self.path, e)),
        }
    }

    fn reopen(&mut self, timeout: Duration) -> Result<()> {
        // Close the line first: its own lock would block reopening, and an adapter that comes back
        // would get another name.
        self.line = None;
        again(timeout, || self.find())
    }
}
