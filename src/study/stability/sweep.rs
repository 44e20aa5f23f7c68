//! Sweeps: cases along one ratio of scales, with one oracle.

use super::case::Case;
use super::{
    boards, exposures, lenses, levels, light, meshes, orders, rays, repeats, scenes, steps,
};
use phasmid_core::error::Result;
use phasmid_report::lab::Context;

/// Cases with one oracle.
pub(super) struct Sweep {
    /// Names its trial.
    pub(super) key: &'static str,
    pub(super) title: &'static str,
    /// What the answer is held against, and what first-order analysis allows.
    pub(super) oracle: &'static str,
    /// What the ratio is, with its unit.
    pub(super) ratio: &'static str,
    /// What the error is, with its unit.
    pub(super) error: &'static str,
    /// Errors are those of rounding in f64, whose last digits differ from machine to machine.
    pub(super) rounding: bool,
    pub(super) cases: fn(&Context<'_>) -> Result<Vec<Case>>,
}

/// Sweeps that belong together.
pub(super) struct Group {
    pub(super) title: &'static str,
    pub(super) sweeps: &'static [Sweep],
}

/// All of them, in the order of the report.
pub(super) const GROUPS: &[Group] = &[
    rays::GROUP,
    scenes::GROUP,
    lenses::GROUP,
    steps::GROUP,
    levels::GROUP,
    orders::GROUP,
    meshes::GROUP,
    boards::GROUP,
    light::GROUP,
    exposures::GROUP,
    repeats::GROUP,
];
