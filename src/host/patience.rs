//! Waits that end, whoever keeps the time.

use super::CommandPort;
use phasmid_core::error::{Error, Result};
use std::time::{Duration, Instant};

/// How often to look whether a device has come back.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// What is left of a wait. A port that gives nothing has used all that it was given, by its own
/// clock: a device in memory lets virtual time pass and comes back at once. A port that gives
/// something has used what the system's clock says.
pub(super) struct Patience {
    left: Duration,
}

impl Patience {
    pub(super) fn new(left: Duration) -> Self {
        Self { left }
    }

    /// Nothing that is worth a longer wait than this is expected any more.
    pub(super) fn shorten(&mut self, most: Duration) {
        self.left = self.left.min(most);
    }

    /// Receives within what is left; 0 when nothing came and nothing is left.
    ///
    /// # Errors
    /// A port that has gone.
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

/// Opens what has gone until that works: a name may be gone, lead nowhere yet, or not be the user's
/// yet.
///
/// # Errors
/// A device that does not come back within the timeout.
pub(super) fn again<T>(timeout: Duration, mut open: impl FnMut() -> Result<T>) -> Result<T> {
    let begin = Instant::now();
    loop {
        match open() {
            Err(error) if begin.elapsed() >= timeout => {
                return Err(Error::device(format!(
                    "the device has gone and has not come back within {} s: {error}",
                    timeout.as_secs_f64()
                )));
            }
            Err(_) => std::thread::sleep(LOOK_AGAIN),
            opened => return opened,
        }
    }
}
