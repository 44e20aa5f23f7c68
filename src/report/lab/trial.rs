//! One trial of a study.

use super::folder::Folder;
use super::row::Row;
use super::settings::Settings;
use crate::stopwatch::Stopwatch;
use phasmid_core::error::Result;
use std::time::Duration;

type Work = Box<dyn Fn(&Context<'_>) -> Result<Vec<Row>> + Send + Sync>;

/// What is done once and written down as one row or a few.
pub struct Trial {
    /// Names it among the trials of its study: letters, digits, `-`, `_`, `.`, `=` and `/`.
    pub key: String,
    /// Seed of its noise, as its rows say.
    pub seed: u64,
    /// Whether it is timed, so that nothing else may run meanwhile.
    pub alone: bool,
    pub(super) work: Work,
}

impl Trial {
    /// A trial that may run beside others.
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

    /// The same trial with nothing beside it.
    #[must_use]
    pub fn alone(mut self) -> Self {
        self.alone = true;
        self
    }
}

/// What a trial is run with.
pub struct Context<'a> {
    /// The study's settings.
    pub settings: &'a Settings,
    /// The trial's seed.
    pub seed: u64,
    /// Where it may leave files for the study's document.
    pub folder: &'a Folder,
    pub(super) clock: &'a (dyn Fn() -> Duration + Sync),
}

impl Context<'_> {
    /// What something gives, and the seconds that it takes.
    pub fn timed<T>(&self, work: impl FnOnce() -> T) -> (T, f64) {
        self.stopwatch().timed(work)
    }

    /// What takes times by the study's clock.
    pub fn stopwatch(&self) -> Stopwatch<'_> {
        Stopwatch::new(self.clock)
    }
}
