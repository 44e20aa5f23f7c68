//! Python bindings of Phasmid: the extension `phasmid._phasmid`, on which the Python modules of
//! `python/phasmid` are built.
//!
//! | file | contents |
//! | --- | --- |
//! | `cli` | the command line |

mod cli;

use pyo3::prelude::*;

#[pymodule]
mod _phasmid {
    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
    #[pymodule_export]
    use super::cli::run;
}
