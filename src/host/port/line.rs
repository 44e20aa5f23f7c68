//! A serial line of the `serialport` library: opened exclusively, in raw mode, and with bounded waits.
//!
//! On Unix the line's file descriptor is made non-blocking. The kernel may report that a descriptor
//! is ready although a write blocks: a blocking write to a pty whose other side does not read
//! (`n_tty_write`) never returns. The same holds for a USB port whose device refuses data.

use serialport::{ClearBuffer, ErrorKind as Kind, SerialPort};
use std::io::{Error, ErrorKind, Read, Result, Write};
use std::time::{Duration, Instant};

#[cfg(windows)]
use serialport::COMPort as Port;
#[cfg(unix)]
use serialport::TTYPort as Port;

/// Baud rate expected of a device on a physical line; ptys and USB ignore it.
const BAUD_RATE: u32 = 115_200;
/// Maximum wait between two attempts to write. It must be short, because Linux may wake the writer
/// of a pty before there is room, and then does not wake it again.
const LOOK_AGAIN: Duration = Duration::from_millis(5);
/// Wait before the next write if the line reports that it is ready but accepts nothing.
const PAUSE: Duration = Duration::from_millis(1);

/// An open line.
pub(super) struct Line(Port);

impl Line {
    /// Opens a line exclusively for this process and discards data waiting on it.
    ///
    /// # Errors
    /// Returns the system's error: `ResourceBusy` if another program has opened the line, `InvalidInput` if
    /// the path is not a serial line.
    pub(super) fn open(path: &str) -> Result<Self> {
        // `serialport` preserves the kind of only a few file system errors, so check for these first.
        #[cfg(unix)]
        if std::fs::metadata(path)?.is_dir() {
            return Err(ErrorKind::IsADirectory.into());
        }
        let port = serialport::new(path, BAUD_RATE).open_native();
        let port = port.map_err(failed)?;
        #[cfg(unix)]
        {
            use nix::fcntl::{FcntlArg, OFlag, fcntl};
            use std::os::fd::AsRawFd;
            fcntl(port.as_raw_fd(), FcntlArg::F_SETFL(OFlag::O_NONBLOCK))?;
        }
        let line = Self(port);
        line.0.clear(ClearBuffer::Input)?;
        Ok(line)
    }

    /// Writes as many bytes as the line accepts within the timeout; returns their number.
    ///
    /// # Errors
    /// Returns an error if the line is gone.
    pub(super) fn write(&mut self, bytes: &[u8], timeout: Duration) -> Result<usize> {
        let begin = Instant::now();
        let mut taken = 0;
        loop {
            let left = timeout.saturating_sub(begin.elapsed());
            self.0.set_timeout(left.min(LOOK_AGAIN))?;
            match self.0.write(&bytes[taken..]) {
                Ok(len) => taken += len,
                Err(e) if e.kind() == ErrorKind::WouldBlock => {
                    std::thread::sleep(PAUSE.min(left));
                }
                Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
                Err(e) => return Err(e),
            }
            if taken == bytes.len() || left.is_zero() {
                return Ok(taken);
            }
        }
    }

    /// Reads the available bytes after waiting for the first one. Returns `None` if no byte comes within
    /// the timeout, 0 if the line has ended.
    ///
    /// # Errors
    /// Returns an error if the line is gone.
    pub(super) fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<Option<usize>> {
        let begin = Instant::now();
        loop {
            let left = timeout.saturating_sub(begin.elapsed());
            self.0.set_timeout(left)?;
            match self.0.read(buffer) {
                Ok(len) => return Ok(Some(len)),
                Err(e) if e.kind() == ErrorKind::TimedOut => return Ok(None),
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {
                    if left.is_zero() {
                        return Ok(None);
                    }
                }
                Err(e) => return Err(e),
            }
        }
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        // Discard unsent data: closing a line whose device does not accept it would block, for 30 s
        // with most drivers. Errors here mean that the line is gone.
        let _ = self.0.clear(ClearBuffer::Output);
        // Release the exclusive lock explicitly: if another program holds the line open too,
        // closing the line would not release it.
        #[cfg(unix)]
        let _ = self.0.set_exclusive(false);
    }
}

fn failed(error: serialport::Error) -> Error {
    match error.kind() {
        Kind::Io(kind) => Error::from(kind),
        Kind::NoDevice if cfg!(unix) => ErrorKind::ResourceBusy.into(),
        Kind::NoDevice => Error::new(ErrorKind::NotFound, error),
        #[cfg(unix)]
        _ if error.description == nix::errno::Errno::ENOTTY.desc() => {
            ErrorKind::InvalidInput.into()
        }
        _ => Error::other(error),
    }
}
