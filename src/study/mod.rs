//! What needs both halves: scans scored against the truth, and reports about them.

pub mod calibration;
pub mod faults;
pub mod report;
pub mod score;
