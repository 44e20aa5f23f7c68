//! Everything that needs device side and host side: scans scored against the truth, reports about them,
//! and the studies ([`ALL`]), whose tables and plots anyone can reproduce.

pub mod acceptance;
pub mod boards;
pub mod calibration;
pub mod clinic;
pub mod desk;
mod draws;
pub mod faults;
pub mod left_out;
pub mod links;
pub mod noise;
pub mod paper;
pub mod report;
pub mod sampling;
pub mod scanned;
pub mod score;
pub mod sgrt;
pub mod stability;
pub mod timing;
pub mod tradeoff;
pub mod work_precision;

use acceptance::Acceptance;
use left_out::LeftOut;
use noise::Noise;
use paper::Paper;
use phasmid_report::lab::Study;
use sgrt::Sgrt;
use stability::Stability;
use work_precision::WorkPrecision;

/// All studies, in the order of the report.
pub const ALL: &[&dyn Study] = &[
    &Paper,
    &WorkPrecision,
    &Stability,
    &LeftOut,
    &Noise,
    &Sgrt,
    &Acceptance,
];
