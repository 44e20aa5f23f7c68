//! `phasmid record`: inspects and exports recordings.

mod export;
mod info;
mod recording;

pub(super) use recording::{Recording, folder_of};

use phasmid_core::error::{Error, Result};
use phasmid_protocol::record::Reader;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

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

/// Opens a recording.
///
/// # Errors
/// Returns an error if the file cannot be opened, or is not a regular file or not a recording.
pub(super) fn open(path: &Path) -> Result<Reader<BufReader<File>>> {
    phasmid_core::file::regular(path)?;
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    Reader::new(BufReader::new(file), &path.display().to_string())
}

/// Returns the seconds since 1970, or 0 if the clock is set to an earlier time.
pub(super) fn unix_s() -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    since.map_or(0, |since| since.as_secs())
}
