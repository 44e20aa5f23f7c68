//! `phasma scan`.

use crate::error::Result;

/// (to be written)
#[derive(Debug, clap::Args)]
pub struct Args {}

/// (to be written)
pub fn run(_args: &Args) -> Result<()> {
    Ok(())
}
