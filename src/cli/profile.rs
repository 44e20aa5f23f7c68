//! `phasma profile`: lists the built-in profiles and checks profile files.

use crate::decode::Plan;
use crate::error::Result;
use crate::profile::{Profile, TomlSource, profile_names};
use crate::protocol::dialect::Dialect;
use std::path::Path;

/// List or check device profiles.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// List the built-in profiles.
    List,
    /// Check a profile file (or a built-in profile) and say what it describes; or a dialect.
    Check {
        /// Path of a TOML file, or a built-in name.
        file: String,
    },
}

pub(super) fn run(args: &Args) -> Result<()> {
    match &args.action {
        Action::List => {
            for name in profile_names() {
                println!("{name:<16}{}", Profile::load(name)?.description);
            }
        }
        Action::Check { file } if names_dialect(file)? => {
            super::dialect::check(file, Dialect::load(file)?)?;
        }
        Action::Check { file } => {
            let profile = Profile::load(file)?;
            let Profile {
                camera, projector, ..
            } = &profile;
            println!("{file}: ok");
            println!("  name        {}", profile.name);
            println!(
                "  camera      {} x {}, focal length {:.2} px, {}",
                camera.width_px,
                camera.height_px,
                camera.view().lens.focal_px.x,
                String::from_utf8_lossy(&camera.format.fourcc()),
            );
            println!(
                "  projector   {} x {}, focal length {:.2} px, baseline {:.1} mm",
                projector.width_px,
                projector.height_px,
                projector.view().lens.focal_px.x,
                projector.view().center().length(),
            );
            for sequence in &profile.sequence {
                println!(
                    "  sequence    {}: {} frames, one every {} us",
                    sequence.name,
                    sequence.frame.len(),
                    sequence.period_us
                );
                // A sequence may be meant for something else than decoding: no mistake.
                if let Err(why) = Plan::new(&profile.manifest(sequence)) {
                    println!("              cannot be decoded: {why}");
                }
            }
        }
    }
    Ok(())
}

/// Whether a name or a file is a dialect's; of a file its `framing` says so.
pub(super) fn names_dialect(file: &str) -> Result<bool> {
    if profile_names().any(|name| name == file) {
        return Ok(false);
    }
    let shipped = Dialect::names().any(|name| name == file);
    let path = Path::new(file);
    Ok(shipped || path.is_file() && TomlSource::read(path)?.has("framing"))
}
