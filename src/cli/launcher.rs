//! The program that runs the command line.

use phasmid_report::lab::Study;
use phasmid_study::ALL;
use std::path::PathBuf;

/// Information that the command line cannot determine itself when it runs as a library.
#[derive(Clone, Default)]
pub struct Launcher {
    /// File that contains this library's code: the program itself, or the module that another
    /// program has loaded. A study records the checksum of this file.
    pub program: Option<PathBuf>,
    /// Additional studies, which `phasmid study` and `phasmid report` offer besides the library's
    /// studies.
    pub studies: &'static [&'static dyn Study],
}

impl Launcher {
    /// Returns the library's studies and the additional ones.
    pub(super) fn all_studies(&self) -> Vec<&'static dyn Study> {
        ALL.iter().chain(self.studies).copied().collect()
    }
}
