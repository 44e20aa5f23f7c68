//! Recordings of served devices and of scans, their replays, and what happens when a process is
//! killed or a client departs from the recorded path.
//!
//! A separate test program whose tests run one after the other: its clients reconnect to the ports
//! of killed devices, and the kernel may assign such a port's number to a device of another test.

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
