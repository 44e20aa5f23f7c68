//! The command line through the extension.

use phasmid::cli::{self, Launcher};
use pyo3::prelude::*;
use std::ffi::OsString;
use std::path::PathBuf;

/// Runs a command and returns its exit status. `program` is the path of this extension.
///
/// The interpreter's lock is released: the command runs as in a program of its own.
#[pyfunction]
pub fn run(py: Python<'_>, arguments: Vec<OsString>, program: PathBuf) -> u8 {
    let launcher = Launcher {
        program: Some(program),
        ..Launcher::default()
    };
    py.detach(|| cli::main(arguments, &launcher))
}
