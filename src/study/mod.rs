//! What needs both halves: scans scored against the truth, and the demo.

pub mod score;
