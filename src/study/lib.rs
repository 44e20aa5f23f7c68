//! What needs both halves: scans scored against the truth, reports about them, and the studies
//! ([`ALL`]) whose tables and plots anyone can make again.

pub mod acceptance;
mod all;
pub mod boards;
pub mod calibration;
pub mod clinic;
pub mod desk;
mod draws;
pub mod faults;

pub mod noise;
pub mod paper;
pub mod report;
pub mod sampling;
pub mod scanned;
pub mod score;
pub mod sgrt;
pub mod speed;
pub mod stability;
pub mod timing;
pub mod work_precision;

pub use all::ALL;
