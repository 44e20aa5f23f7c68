//! A serial line as the system has it: opened exclusively, raw, and never waited for longer than
//! asked.

#[cfg(not(unix))]
pub(super) use elsewhere::Line;
#[cfg(unix)]
pub(super) use terminal::Line;

/// Ignored by ptys and USB; a device on a real line is expected at this rate.
const BAUD_RATE: u32 = 115_200;

/// A terminal of a Unix. Its descriptor never blocks, for "ready to be written to" is a promise that
/// the kernel does not keep: a pty whose other side does not read is ready, and a write that waits
/// there (`n_tty_write`) waits without an end; so does one to a USB port whose device refuses data.
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

    /// Longest wait between two writes: Linux wakes a pty's writer before there is room, and not
    /// again afterwards.
    const LOOK_AGAIN: Duration = Duration::from_millis(5);
    /// Shortest wait between two writes, where the line says that it is ready and takes nothing.
    const PAUSE: Duration = Duration::from_millis(1);

    /// An open line.
    pub(in crate::port) struct Line(OwnedFd);

    impl Line {
        /// Opens a line for this process alone, and forgets what was waiting on it.
        ///
        /// # Errors
        /// The system's; `ResourceBusy` for a line that another program has opened so.
        pub(in crate::port) fn open(path: &str) -> Result<Self> {
            let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
            let file = open(path, flags, Mode::empty())?;
            // Root is let in by the kernel whoever has the line; this keeps out another one of us.
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
            // No handshake: CTS and RTS may not be wired, XON and XOFF are data. One stop bit.
            modes.control_modes -= ControlModes::CRTSCTS | ControlModes::CSTOPB;
            modes.set_speed(BAUD_RATE)?;
            tcsetattr(file, OptionalActions::Now, &modes)?;
            // It is said to have worked where a part of it has.
            let set = tcgetattr(file)?;
            let raw = (set.input_modes, set.output_modes, set.local_modes)
                == (modes.input_modes, modes.output_modes, modes.local_modes);
            if !raw {
                return Err(Error::other("the line cannot be set to carry plain bytes"));
            }
            tcflush(file, QueueSelector::IFlush)?;
            Ok(line)
        }

        /// Writes what the line takes within the timeout, and says how much that was.
        ///
        /// # Errors
        /// A line that has gone.
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

        /// Reads what has come, waiting for the first byte; `None` when none has come in time, 0
        /// where none will any more.
        ///
        /// # Errors
        /// A line that has gone.
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

        /// Waits until the line is ready or has gone; whether that was so in time.
        fn wait(&self, what: PollFlags, time: Duration) -> Result<bool> {
            // Longer than a `Timespec` holds is as good as for ever.
            let time = Timespec::try_from(time).ok();
            match poll(&mut [PollFd::new(&self.0, what)], time.as_ref()) {
                Ok(ready) => Ok(ready > 0),
                // Whoever waits looks at the time that is left.
                Err(Errno::INTR) => Ok(false),
                Err(error) => Err(error.into()),
            }
        }
    }

    impl Drop for Line {
        fn drop(&mut self) {
            // To close a line that does not take what was written is to wait for it, 30 s for most
            // drivers. What fails here fails on a line that has gone.
            let _ = tcflush(&self.0, QueueSelector::OFlush);
            let _ = ioctl_tiocnxcl(&self.0);
        }
    }
}

/// A port by the `serialport` library, whose writes end in time where the system's do (Windows).
#[cfg(not(unix))]
mod elsewhere {
    use super::BAUD_RATE;
    use serialport::{ClearBuffer, ErrorKind as Kind, SerialPort};
    use std::io::{Error, ErrorKind, Read, Result, Write};
    use std::time::{Duration, Instant};

    /// An open line.
    pub(in crate::port) struct Line(Box<dyn SerialPort>);

    impl Line {
        /// Opens a line, and forgets what was waiting on it.
        ///
        /// # Errors
        /// The system's.
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

        /// Writes what the line takes within the timeout, and says how much that was.
        ///
        /// # Errors
        /// A line that has gone.
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

        /// Reads what has come, waiting for the first byte; `None` when none has come in time, 0
        /// where none will any more.
        ///
        /// # Errors
        /// A line that has gone.
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
