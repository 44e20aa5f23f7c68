//! Python bindings of Phasmid: the extension `phasmid._phasmid`, on which the Python modules of
//! `python/phasmid` are built. The extension contains only code that needs Rust; classes with
//! documentation, defaults and conversions are in Python.
//!
//! The crate is a member of the workspace, so it uses the same profiles, patches and package
//! versions as the other crates.
//!
//! | file | contents |
//! | --- | --- |
//! | `arrays` | arrays of numpy from and to images and maps |
//! | `calibrate` | calibration from captures of a board |
//! | `call` | long calls on a thread pool, which Ctrl-C ends; values that threads share |
//! | `cli` | the command line |
//! | `decode` | the decoder |
//! | `device` | an emulated device, in memory and served |
//! | `documents` | profiles, scenes, manifests and calibrations |
//! | `errors` | errors as exceptions |
//! | `results` | captures, maps and truths as parts of Python's classes, and back; comparison |
//! | `scanner` | a scanner at its addresses |
//! | `track` | tracking of a patient |

mod arrays;
mod calibrate;
mod call;
mod cli;
mod decode;
mod device;
mod documents;
mod errors;
mod results;
mod scanner;
mod track;

use pyo3::prelude::*;

#[pymodule]
mod _phasmid {
    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
    #[pymodule_export]
    use super::arrays::write_png;
    #[pymodule_export]
    use super::calibrate::{board, board_poses, calibrate};
    #[pymodule_export]
    use super::cli::run;
    #[pymodule_export]
    use super::decode::{Decoder, verdicts};
    #[pymodule_export]
    use super::device::{Device, Serving};
    #[pymodule_export]
    use super::documents::{Manifest, Profile, Rig, Scene, toml};
    #[pymodule_export]
    use super::results::compare;
    #[pymodule_export]
    use super::scanner::Scanner;
    #[pymodule_export]
    use super::track::{Planning, Pod, export_planning, track};
}
