//! Recordings of served devices and of scans, replays of them, and what becomes of both when
//! somebody is killed or does something else than was recorded.
//!
//! A program of its own: its clients come back to the ports of devices that were killed, and the
//! kernel may give such a port's number to a device of another test.

mod files;
mod replays;
#[path = "../support/served.rs"]
mod served;
