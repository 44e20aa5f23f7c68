//! One trial of a study.

use super::folder::Folder;
use super::row::Row;
use super::settings::Settings;
use crate::stopwatch::Stopwatch;
use phasmid_core::Stop;
use phasmid_core::error::Result;
use std::time::Duration;

type Work = Box<dyn Fn(&Context<'_>) -> Result<Vec<Row>> + Send + Sync>;

/// A piece of work that is done once and stored as one or several rows.
pub struct Trial {
    /// Unique key among the trials of its study: letters, digits, `-`, `_`, `.`, `=` and `/`.
    pub key: String,
    /// Seed of the trial's noise, which is stored in the trial's rows.
    pub seed: u64,
    /// Whether no other trial may run at the same time, because this trial measures times.
    pub alone: bool,
    pub(super) work: Work,
}

impl Trial {
    /// Makes a trial that may run in parallel with others.
    pub fn new(
        key: impl Into<String>,
        seed: u64,
        work: impl Fn(&Context<'_>) -> Result<Vec<Row>> + Send + Sync + 'static,
    ) -> Self {
        Self {
            key: key.into(),
            seed,
            alone: false,
            work: Box::new(work),
        }
    }

    /// Makes the trial run alone.
    #[must_use]
    pub fn alone(mut self) -> Self {
        self.alone = true;
        self
    }
}

/// The context in which a trial runs.
pub struct Context<'a> {
    /// The study's settings.
    pub settings: &'a Settings,
    /// The trial's seed.
    pub seed: u64,
    /// Folder in which the trial may write files for the study's document.
    pub folder: &'a Folder,
    /// Request to end the study. A trial may pass the request on to calls that take a long time. If the
    /// study is asked to end during a trial, the trial's rows are dropped.
    pub stop: &'a Stop,
    pub(super) clock: &'a (dyn Fn() -> Duration + Sync),
}

impl Context<'_> {
    /// Runs `work`; returns its result and its duration in seconds.
    pub fn timed<T>(&self, work: impl FnOnce() -> T) -> (T, f64) {
        self.stopwatch().timed(work)
    }

    /// Returns a stopwatch with the study's clock.
    pub fn stopwatch(&self) -> Stopwatch<'_> {
        Stopwatch::new(self.clock)
    }
}
