//! The system's monotonic clock, which V4L2 uses for frame timestamps; and bounded waits, in system
//! time or in a simulated device's virtual time.

use super::CommandPort;
use phasmid_core::error::{Error, Result};
use std::time::{Duration, Instant};

/// Interval at which to check whether a device has come back.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// Returns the system's monotonic time in nanoseconds, the clock of V4L2 timestamps; 0 on systems
/// without it.
#[cfg(unix)]
pub fn monotonic_ns() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    let seconds = u64::try_from(now.tv_sec).unwrap_or(0);
    seconds * 1_000_000_000 + u64::try_from(now.tv_nsec).unwrap_or(0)
}

/// Always returns 0, because no driver on this system timestamps frames by a monotonic clock.
#[cfg(not(unix))]
pub fn monotonic_ns() -> u64 {
    0
}

/// The remaining time of a wait. A receive that returns no data counts as having used all the time
/// it was given, because an in-memory device lets virtual time pass and returns at once. For a
/// receive that returns data, the time measured by the system clock counts.
pub(super) struct Deadline {
    left: Duration,
}

impl Deadline {
    pub(super) fn new(left: Duration) -> Self {
        Self { left }
    }

    /// Limits the remaining wait to `most`.
    pub(super) fn shorten(&mut self, most: Duration) {
        self.left = self.left.min(most);
    }

    /// Receives within the remaining time; returns 0 when no data came and no time is left.
    ///
    /// # Errors
    /// Returns an error if the port is gone.
    pub(super) fn receive(
        &mut self,
        port: &mut impl CommandPort,
        buffer: &mut [u8],
    ) -> Result<usize> {
        let begin = Instant::now();
        let len = port.receive(buffer, self.left)?;
        self.left = match len {
            0 => Duration::ZERO,
            _ => self.left.saturating_sub(begin.elapsed()),
        };
        Ok(len)
    }
}

/// Retries `open` until it succeeds: while a device reattaches, its path may be missing, dangling,
/// or not yet accessible to the user.
///
/// Returns an error if the device does not come back within the timeout.
pub(super) fn again<T>(timeout: Duration, mut open: impl FnMut() -> Result<T>) -> Result<T> {
    let begin = Instant::now();
    loop {
        match open() {
            Err(error) if begin.elapsed() >= timeout => {
                return Err(Error::device(format!(
                    "the device disconnected and did not come back within {} s: {error}",
                    timeout.as_secs_f64()
                )));
            }
            Err(_) => std::thread::sleep(LOOK_AGAIN),
            opened => return opened,
        }
    }
}
