//! Replaces `phasmid serve`, `replay`, `demo` and `doctor` on systems other than Linux: reports that
//! these commands are not available.

use phasmid_core::error::{Error, Result};

/// Not in this build: it needs Linux.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    _rest: Vec<String>,
}

pub(super) fn run(_: &Args) -> Result<()> {
    Err(Error::device(
        "serve, replay, demo and doctor need Linux; scan, decode and compare work here",
    ))
}
