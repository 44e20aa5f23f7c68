//! The studies that there are.

use super::acceptance::Acceptance;
use super::noise::Noise;
use super::paper::Paper;
use super::sgrt::Sgrt;
use super::speed::Speed;
use super::stability::Stability;
use super::work_precision::WorkPrecision;
use phasmid_report::lab::Study;

/// All studies, in the order in which a report has them.
pub const ALL: &[&dyn Study] = &[
    &Paper,
    &WorkPrecision,
    &Stability,
    &Noise,
    &Speed,
    &Sgrt,
    &Acceptance,
];
