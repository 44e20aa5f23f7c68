//! `phasma serve`, `demo` and `doctor` where there is no link: they say so.

use crate::error::{Error, Result};

/// Not in this build: it needs Linux.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    _rest: Vec<String>,
}

pub(super) fn run(_: &Args) -> Result<()> {
    Err(Error::device(
        "this build has no link, through which a device reaches the world: serving one, and to ask whether one can be served, needs Linux; \
         scan, decode and compare work here",
    ))
}
