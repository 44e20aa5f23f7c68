//! `phasmid schema`: prints the JSON Schema of a kind of file that users write.

use phasmid_core::error::{Error, Result};
use phasmid_profile::Document;

/// Print the JSON Schema of a kind of file, with which editors complete and check it
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  phasmid schema profile > profile.schema.json")]
pub(super) struct Args {
    /// profile, scene, station, patient, manifest, faults or dialect
    kind: String,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let found = Document::ALL
        .iter()
        .find(|document| document.name() == args.kind);
    let Some(document) = found else {
        let names: Vec<&str> = Document::ALL
            .iter()
            .map(|document| document.name())
            .collect();
        let found = format!("{:?}", args.kind);
        return Err(Error::input("kind of file", found, names.join(", ")));
    };
    print!("{}", document.schema());
    Ok(())
}
