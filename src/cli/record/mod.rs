//! `phasmid record`: inspects and exports recordings.

mod export;
mod info;
mod recording;

pub(super) use recording::{Recording, folder_of};
#[cfg(target_os = "linux")]
pub(super) use recording::{open, unix_s};

use phasmid_core::error::Result;
use std::path::PathBuf;

/// Inspect or export recordings of `serve --record` and `scan --record`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Report what a recording contains, how it ends, and where it is damaged.
    #[command(after_help = "Example:\n  phasmid record info day.rec")]
    Info {
        /// Recording to read.
        file: PathBuf,
        /// Print the report as JSON.
        #[arg(long)]
        json: bool,
    },
    /// Write the frames as images and the conversation as text.
    #[command(after_help = "Example:\n  phasmid record export day.rec --out exported")]
    Export {
        /// Recording to read.
        file: PathBuf,
        /// Folder for the files.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Overwrite an earlier export.
        #[arg(long)]
        force: bool,
    },
}

pub(super) fn run(args: &Args) -> Result<()> {
    match &args.action {
        Action::Info { file, json } => info::run(file, *json),
        Action::Export { file, out, force } => export::run(file, out, *force),
    }
}
