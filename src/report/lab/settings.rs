//! What a study is run with.

use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What decides the figures of a study: with the same settings and the same program a second run has
/// the same rows, but for times.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Settings {
    /// The form of less than a minute.
    pub quick: bool,
    /// Seed of every noise and every drawn parameter.
    pub seed: u64,
    /// Only the trials of this part; see [`Study::parts`](super::Study::parts).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub only: Option<String>,
}

/// What a study runs in; none of it changes a figure but times.
pub struct Surroundings<'a> {
    /// Time since some moment, for what is timed.
    pub clock: &'a (dyn Fn() -> Duration + Sync),
    /// Trials side by side; each has its share of the cores.
    pub jobs: usize,
    /// Which source the program was built from.
    pub revision: &'a str,
}
