//! Recordings of served devices and of scans, replays of recordings, processes that are killed, and
//! clients that depart from the recording.
//!
//! This is a separate test program whose tests run one after the other. Its clients reconnect to the
//! ports of killed devices, and the kernel may assign the number of such a port to a device of
//! another test.

use std::sync::{Mutex, MutexGuard, PoisonError};

mod files;
mod packed;
mod replays;
#[path = "../support/served.rs"]
mod served;

/// Waits until no other test of this program runs.
fn alone() -> MutexGuard<'static, ()> {
    static RUNNING: Mutex<()> = Mutex::new(());
    RUNNING.lock().unwrap_or_else(PoisonError::into_inner)
}
