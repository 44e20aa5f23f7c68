//! `phasmid record`: what recordings hold.

mod export;
mod info;

use phasmid_core::error::{Error, Result};
use phasmid_protocol::record::Reader;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Look at recordings of serve --record and scan --record.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Say what a recording holds, how it ends, and where it is damaged.
    Info {
        /// The recording.
        file: PathBuf,
        /// Print the report as JSON.
        #[arg(long)]
        json: bool,
    },
    /// Write the frames as pictures and the conversation as text.
    Export {
        /// The recording.
        file: PathBuf,
        /// Folder for them.
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
/// What the system refuses, what is no file, and what is no recording.
pub(super) fn open(path: &Path) -> Result<Reader<BufReader<File>>> {
    phasmid_core::file::regular(path)?;
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    Reader::new(BufReader::new(file), &path.display().to_string())
}

/// Seconds since 1970.
pub(super) fn unix_s() -> u64 {
    // A clock that stands before 1970 is none to go by.
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    since.map_or(0, |since| since.as_secs())
}
