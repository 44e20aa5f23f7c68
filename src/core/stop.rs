//! Ends long calls early, from another thread.

use crate::error::{Error, Result};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// A request to end a long call early. Clones share one request.
///
/// The call returns [`Error::Interrupted`] within a fraction of a second. Later calls also return it,
/// until [`Self::reset`].
#[derive(Debug, Clone, Default)]
pub struct Stop(Arc<Request>);

#[derive(Debug, Default)]
struct Request {
    asked: AtomicBool,
    /// Number of times that the calls have been asked to end.
    times: AtomicU64,
}

impl Stop {
    /// Asks the calls to end.
    pub fn ask(&self) {
        self.0.times.fetch_add(1, Ordering::SeqCst);
        self.0.asked.store(true, Ordering::SeqCst);
    }

    /// Lets later calls run again.
    pub fn reset(&self) {
        self.0.asked.store(false, Ordering::SeqCst);
    }

    /// Returns whether the calls have been asked to end.
    #[inline]
    pub fn is_asked(&self) -> bool {
        self.0.asked.load(Ordering::Relaxed)
    }

    /// Returns the number of times that calls have been asked to end. If the number changes during a
    /// call, that call has been asked to end, even if the request was reset since.
    pub fn times(&self) -> u64 {
        self.0.times.load(Ordering::SeqCst)
    }

    /// Returns an error if the calls have been asked to end.
    ///
    /// # Errors
    /// Returns [`Error::Interrupted`] if the calls have been asked to end.
    pub fn check(&self) -> Result<()> {
        match self.is_asked() {
            true => Err(Error::Interrupted),
            false => Ok(()),
        }
    }
}
