//! The settings and the environment of a study's run.

use serde::{Deserialize, Serialize};
use std::time::Duration;

/// Settings that determine the results of a study. With the same settings and the same program, a second
/// run has the same rows, except for times.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Settings {
    /// Whether to run the short form, which takes less than a minute.
    pub quick: bool,
    /// Seed of all noise and all random parameters.
    pub seed: u64,
    /// Only the trials of this part; see [`Study::parts`](super::Study::parts).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub only: Option<String>,
}

/// The environment of a study, which does not affect its results except times.
pub struct Surroundings<'a> {
    /// Time since a fixed moment, for measured times.
    pub clock: &'a (dyn Fn() -> Duration + Sync),
    /// Number of trials to run in parallel, each with its share of the cores.
    pub jobs: usize,
    /// Revision of the program.
    pub revision: &'a str,
}
