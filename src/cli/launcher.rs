//! The program that runs the command line.

use phasmid_report::lab::Study;
use phasmid_study::ALL;
use std::path::PathBuf;

/// Information that the command line cannot determine itself when it runs as a library.
#[derive(Clone, Default)]
pub struct Launcher {
    /// File with this library's code: the program, or the module that another program has loaded. A
    /// study records its checksum.
    pub program: Option<PathBuf>,
    /// More studies, which `phasmid study` and `phasmid report` know in addition to those of the library.
    pub studies: &'static [&'static dyn Study],
}

impl Launcher {
    /// Returns all studies.
    pub(super) fn all_studies(&self) -> Vec<&'static dyn Study> {
        ALL.iter().chain(self.studies).copied().collect()
    }
}
