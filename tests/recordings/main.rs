//! Recordings of served devices and of scans, replays of them, and what becomes of both when
//! somebody is killed or does something else than was recorded.
//!
//! A program of its own whose tests run one after the other: its clients come back to the ports of
//! devices that were killed, and the kernel may give such a port's number to a device of another test.

use std::sync::{Mutex, MutexGuard, PoisonError};

mod files;
mod replays;
#[path = "../support/served.rs"]
mod served;

/// Waits until no other test of this program runs.
fn alone() -> MutexGuard<'static, ()> {
    static RUNNING: Mutex<()> = Mutex::new(());
    RUNNING.lock().unwrap_or_else(PoisonError::into_inner)
}
