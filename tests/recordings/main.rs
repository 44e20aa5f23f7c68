//! Recordings of served devices and of scans, replays of them, and what becomes of both when
//! somebody is killed or does something else than was recorded.

mod files;
mod replays;
#[path = "../serve/served.rs"]
mod served;
