//! The command line through the extension.

use phasmid::cli::{self, Launcher};
use pyo3::prelude::*;
use std::ffi::OsString;
use std::path::PathBuf;

/// Runs a command and returns its exit status. `program` is the path of this extension.
///
/// The command runs without the interpreter's lock, as in a separate process.
#[pyfunction]
pub fn run(py: Python<'_>, arguments: Vec<OsString>, program: PathBuf) -> u8 {
    let launcher = Launcher {
        program: Some(program),
        ..Launcher::default()
    };
    py.detach(|| cli::main(arguments, &launcher))
}
