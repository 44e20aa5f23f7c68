//! A serial line as provided by the operating system: opened exclusively, in raw mode, and with
//! bounded waits.

#[cfg(not(unix))]
pub(super) use elsewhere::Line;
#[cfg(unix)]
pub(super) use terminal::Line;

/// Baud rate expected of a device on a physical line; ptys and USB ignore it.
const BAUD_RATE: u32 = 115_200;

/// A Unix terminal. Its descriptor is non-blocking, because the kernel does not keep its promise
/// that a ready descriptor can be written to: a pty whose other side does not read is reported as
/// ready, and a blocking write to it (`n_tty_write`) never returns. The same holds for a USB port
/// whose device refuses data.
#[cfg(unix)]
mod terminal {
    use super::BAUD_RATE;
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    use rustix::fs::{FlockOperation, Mode, OFlags, flock, open};
    use rustix::io::{Errno, read, write};
    use rustix::termios::{
        ControlModes, OptionalActions, QueueSelector, ioctl_tiocexcl, ioctl_tiocnxcl, tcflush,
        tcgetattr, tcsetattr,
    };
    use std::io::{Error, ErrorKind, Result};
    use std::os::fd::OwnedFd;
    use std::time::{Duration, Instant};

    /// Maximum wait between two writes: Linux wakes a pty's writer before there is room, and not
    /// again afterwards.
    const LOOK_AGAIN: Duration = Duration::from_millis(5);
    /// Minimum wait between two writes if the line reports that it is ready but accepts nothing.
    const PAUSE: Duration = Duration::from_millis(1);

    /// An open line.
    pub(in crate::port) struct Line(OwnedFd);

    impl Line {
        /// Opens a line exclusively for this process and discards data waiting on it.
        ///
        /// # Errors
        /// Returns the system's error; `ResourceBusy` if another program has opened the line
        /// exclusively.
        pub(in crate::port) fn open(path: &str) -> Result<Self> {
            let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
            let file = open(path, flags, Mode::empty())?;
            // The kernel's exclusive mode does not keep root out; this lock excludes other
            // instances of this program.
            flock(&file, FlockOperation::NonBlockingLockExclusive).map_err(|e| match e {
                Errno::WOULDBLOCK => Error::from(ErrorKind::ResourceBusy),
                e => e.into(),
            })?;
            ioctl_tiocexcl(&file)?;
            let line = Self(file);
            let file = &line.0;
            let mut modes = tcgetattr(file)?;
            modes.make_raw();
            modes.control_modes |= ControlModes::CREAD | ControlModes::CLOCAL;
            // No flow control: CTS and RTS may not be wired, and XON and XOFF are data. One stop
            // bit.
            modes.control_modes -= ControlModes::CRTSCTS | ControlModes::CSTOPB;
            modes.set_speed(BAUD_RATE)?;
            tcsetattr(file, OptionalActions::Now, &modes)?;
            // `tcsetattr` reports success even if only some of the settings took effect.
            let set = tcgetattr(file)?;
            let raw = (set.input_modes, set.output_modes, set.local_modes)
                == (modes.input_modes, modes.output_modes, modes.local_modes);
            if !raw {
                return Err(Error::other("the line cannot be set to raw mode"));
            }
            tcflush(file, QueueSelector::IFlush)?;
            Ok(line)
        }

        /// Writes what the line accepts within the timeout; returns the number of bytes.
        ///
        /// # Errors
        /// Returns an error if the line is gone.
        pub(in crate::port) fn write(&mut self, bytes: &[u8], timeout: Duration) -> Result<usize> {
            let begin = Instant::now();
            let mut taken = 0;
            let mut pause = Duration::ZERO;
            loop {
                match write(&self.0, &bytes[taken..]) {
                    Ok(0) | Err(Errno::AGAIN) => {}
                    Ok(len) => {
                        taken += len;
                        pause = Duration::ZERO;
                    }
                    Err(Errno::INTR) => continue,
                    Err(error) => return Err(error.into()),
                }
                let left = timeout.saturating_sub(begin.elapsed());
                if taken == bytes.len() || left.is_zero() {
                    return Ok(taken);
                }
                std::thread::sleep(pause.min(left));
                let ready = self.wait(PollFlags::OUT, LOOK_AGAIN.min(left))?;
                pause = if ready { PAUSE } else { Duration::ZERO };
            }
        }

        /// Reads the available bytes, waiting for the first one; returns `None` if none comes
        /// within the timeout, 0 if the line has ended.
        ///
        /// # Errors
        /// Returns an error if the line is gone.
        pub(in crate::port) fn read(
            &mut self,
            buffer: &mut [u8],
            timeout: Duration,
        ) -> Result<Option<usize>> {
            let begin = Instant::now();
            loop {
                match read(&self.0, &mut *buffer) {
                    Ok(len) => return Ok(Some(len)),
                    Err(Errno::AGAIN) => {}
                    Err(Errno::INTR) => continue,
                    Err(error) => return Err(error.into()),
                }
                let left = timeout.saturating_sub(begin.elapsed());
                if left.is_zero() {
                    return Ok(None);
                }
                self.wait(PollFlags::IN, left)?;
            }
        }

        /// Waits until the line is ready or gone; returns whether that happened within the time.
        fn wait(&self, what: PollFlags, time: Duration) -> Result<bool> {
            // A time that does not fit a `Timespec` counts as infinite.
            let time = Timespec::try_from(time).ok();
            match poll(&mut [PollFd::new(&self.0, what)], time.as_ref()) {
                Ok(ready) => Ok(ready > 0),
                // The caller checks the time that is left.
                Err(Errno::INTR) => Ok(false),
                Err(error) => Err(error.into()),
            }
        }
    }

    impl Drop for Line {
        fn drop(&mut self) {
            // Closing a line that does not accept written data blocks until it does, 30 s with most
            // drivers, so discard the data. Errors here mean that the line is gone.
            let _ = tcflush(&self.0, QueueSelector::OFlush);
            let _ = ioctl_tiocnxcl(&self.0);
        }
    }
}

/// A port of the `serialport` library, whose writes time out if the system supports it (Windows).
#[cfg(not(unix))]
mod elsewhere {
    use super::BAUD_RATE;
    use serialport::{ClearBuffer, ErrorKind as Kind, SerialPort};
    use std::io::{Error, ErrorKind, Read, Result, Write};
    use std::time::{Duration, Instant};

    /// An open line.
    pub(in crate::port) struct Line(Box<dyn SerialPort>);

    impl Line {
        /// Opens a line and discards data waiting on it.
        ///
        /// # Errors
        /// Returns the system's error.
        pub(in crate::port) fn open(path: &str) -> Result<Self> {
            let failed = |e: serialport::Error| match e.kind() {
                Kind::Io(kind) => Error::from(kind),
                Kind::NoDevice => Error::new(ErrorKind::NotFound, e),
                _ => Error::other(e),
            };
            let port = serialport::new(path, BAUD_RATE).open().map_err(failed)?;
            port.clear(ClearBuffer::Input).map_err(failed)?;
            Ok(Self(port))
        }

        /// Writes what the line accepts within the timeout; returns the number of bytes.
        ///
        /// # Errors
        /// Returns an error if the line is gone.
        pub(in crate::port) fn write(&mut self, bytes: &[u8], timeout: Duration) -> Result<usize> {
            let begin = Instant::now();
            let mut taken = 0;
            while taken < bytes.len() {
                let left = timeout.saturating_sub(begin.elapsed());
                if left.is_zero() && taken > 0 {
                    break;
                }
                self.0.set_timeout(left)?;
                match self.0.write(&bytes[taken..]) {
                    Ok(len) => taken += len,
                    Err(e) if e.kind() == ErrorKind::TimedOut => break,
                    Err(e) if e.kind() == ErrorKind::Interrupted => {}
                    Err(e) => return Err(e),
                }
            }
            Ok(taken)
        }

        /// Reads the available bytes, waiting for the first one; returns `None` if none comes
        /// within the timeout, 0 if the line has ended.
        ///
        /// # Errors
        /// Returns an error if the line is gone.
        pub(in crate::port) fn read(
            &mut self,
            buffer: &mut [u8],
            timeout: Duration,
        ) -> Result<Option<usize>> {
            self.0.set_timeout(timeout)?;
            loop {
                match self.0.read(buffer) {
                    Ok(len) => return Ok(Some(len)),
                    Err(e) if e.kind() == ErrorKind::TimedOut => return Ok(None),
                    Err(e) if e.kind() == ErrorKind::Interrupted => {}
                    Err(e) => return Err(e),
                }
            }
        }
    }
}
