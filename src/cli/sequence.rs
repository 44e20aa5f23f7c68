//! `phasmid sequence`: lists the sequences of a profile, and the frames of one.

use super::options::SetArgs;
use phasmid_core::error::{Error, Result};
use phasmid_core::source::TomlSource;
use phasmid_pattern::{Manifest, Pattern};
use phasmid_profile::{Profile, Sequence, profile_names};
use std::path::Path;

/// List the sequences of a profile or the frames of one
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// List the sequences of a profile.
    #[command(after_help = "Example:\n  phasmid sequence list pmp-bench")]
    List {
        /// Device profile: a built-in name or a TOML file.
        profile: String,
        #[command(flatten)]
        set: SetArgs,
    },
    /// List the frames of a sequence, with its sets of patterns written out.
    #[command(after_help = "Example:\n  phasmid sequence show pmp-bench pmp-12")]
    Show {
        /// Device profile, a built-in name or a TOML file; or a manifest.
        file: String,
        /// Sequence of the profile [default: its first]
        sequence: Option<String>,
        #[command(flatten)]
        set: SetArgs,
        /// Print the manifest instead, as TOML
        #[arg(long)]
        toml: bool,
    },
}

pub(super) fn run(args: &Args) -> Result<()> {
    match &args.action {
        Action::List { profile, set } => {
            let profile = Profile::load_with(profile, &set.of_profile()?)?;
            for Sequence {
                name,
                period_us,
                frame,
            } in &profile.sequence
            {
                println!(
                    "{name:<16}{:>4} frames, one every {period_us} us",
                    frame.len()
                );
            }
            Ok(())
        }
        Action::Show {
            file,
            sequence,
            set,
            toml,
        } => {
            let manifest = manifest(file, sequence.as_deref(), set)?;
            if *toml {
                print!("{}", manifest.to_toml());
            } else {
                show(&manifest);
            }
            Ok(())
        }
    }
}

/// Returns a sequence of a profile, or a manifest. A file is a manifest if it has the key `frame`,
/// or the key `projector` without `name`, `camera` and `extends`.
fn manifest(file: &str, sequence: Option<&str>, set: &SetArgs) -> Result<Manifest> {
    let path = Path::new(file);
    let is_profile = profile_names().any(|name| name == file) || !path.is_file();
    let is_manifest = |source: &TomlSource| {
        let of_profile = ["name", "camera", "extends"];
        source.has("frame")
            || source.has("projector") && !of_profile.iter().any(|key| source.has(key))
    };
    if !is_profile && is_manifest(&TomlSource::read(path)?) {
        if let Some(name) = sequence {
            return Err(Error::input(
                format!("sequence {name}"),
                format!("{file} is a manifest"),
                "no name: a manifest has one sequence",
            ));
        }
        set.refuse(&format!("{file} is a manifest"))?;
        return Manifest::read(path);
    }
    let profile = Profile::load_with(file, &set.of_profile()?)?;
    let wanted = sequence.unwrap_or(&profile.sequence[0].name);
    let found = profile.sequence.iter().find(|s| s.name == wanted);
    let found = found.ok_or_else(|| {
        let names: Vec<&str> = profile.sequence.iter().map(|s| s.name.as_str()).collect();
        Error::input(
            format!("sequence {wanted:?}"),
            format!("not in profile {file}"),
            names.join(", "),
        )
    })?;
    Ok(profile.manifest(found))
}

fn show(manifest: &Manifest) {
    let size = manifest.projector;
    println!("projector {} x {}", size.width_px, size.height_px);
    println!("frame  pattern  axis  width_px  phase or bit");
    for (i, frame) in manifest.frame.iter().enumerate() {
        let axis = frame
            .pattern
            .axis()
            .map_or("-".to_owned(), |axis| axis.to_string());
        let (kind, width, rest) = match &frame.pattern {
            Pattern::Fringe {
                period_px,
                phase_rad,
                ..
            } => {
                let degrees = phase_rad.to_degrees();
                (
                    "fringe",
                    period_px.to_string(),
                    format!("{degrees:.3} degrees"),
                )
            }
            Pattern::Gray {
                cell_px,
                bits,
                bit,
                inverted,
                ..
            } => {
                let inverted = if *inverted { ", inverted" } else { "" };
                (
                    "gray",
                    cell_px.to_string(),
                    format!("bit {bit} of {bits}{inverted}"),
                )
            }
            Pattern::White {} => ("white", "-".to_owned(), "-".to_owned()),
            Pattern::Black {} => ("black", "-".to_owned(), "-".to_owned()),
            Pattern::Image { file } => ("image", "-".to_owned(), file.display().to_string()),
        };
        println!("{i:>5}  {kind:<7}  {axis:<4}  {width:>8}  {rest}");
    }
}
