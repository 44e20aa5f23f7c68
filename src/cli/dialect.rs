//! `phasmid dialect`: lists and prints the built-in dialects and checks dialect files.

use phasmid_core::error::Result;
use phasmid_device::port::Port;
use phasmid_profile::{Profile, Settings, Station, StationDevice};
use phasmid_protocol::dialect::Dialect;
use std::sync::Arc;

/// List, print or check dialects of the control port.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// List the built-in dialects.
    #[command(after_help = "Example:\n  phasmid dialect list")]
    List,
    /// Print the file of a built-in dialect, as a starting point for your own.
    #[command(after_help = "Example:\n  phasmid dialect show okline > own.toml")]
    Show {
        /// Built-in name.
        name: String,
    },
    /// Check a dialect file (or a built-in dialect) and summarise it.
    #[command(after_help = "Example:\n  phasmid dialect check own.toml")]
    Check {
        /// Path of a TOML file, or a built-in name.
        file: String,
    },
}

pub(super) fn run(args: &Args) -> Result<()> {
    match &args.action {
        Action::List => {
            for name in Dialect::names() {
                println!("{name:<16}{}", Dialect::load(name)?.description());
            }
        }
        Action::Show { name } => {
            super::output::show("dialect", name, Dialect::text(name), Dialect::names())?
        }
        Action::Check { file } => check(file, Dialect::load(file)?)?,
    }
    Ok(())
}

/// Returns the control port of a device, with the dialect of its profile.
///
/// # Errors
/// Returns an error if the dialect is invalid, does not suit the serial line, or names commands that
/// the device does not have.
pub(super) fn port(profile: &Profile) -> Result<Port> {
    let dialect = profile.control.load_dialect(&profile.folder)?;
    Port::new(Arc::new(dialect))
}

/// Replaces the dialect of a profile. A path is relative to the working directory. `place` is the
/// option or field that error messages name.
pub(super) fn speak(profile: &mut Profile, name_or_path: &str, place: &str) {
    profile.control.dialect = Dialect::from_anywhere(name_or_path);
    profile.control.places.dialect = place.to_owned();
}

/// Loads the profile of a station's device, with the station's dialect if it names one.
///
/// # Errors
/// Same as [`Profile::load`].
pub(super) fn profile_of(
    station: &Station,
    device: &StationDevice,
    settings: &Settings,
) -> Result<Profile> {
    let mut profile = Profile::load_with(&station.profile(device), settings)?;
    if let Some(serial) = &device.serial {
        profile.identity.serial.clone_from(serial);
    }
    if let Some(dialect) = station.dialect(device) {
        speak(&mut profile, &dialect, &device.dialect_place);
    }
    Ok(profile)
}

/// Checks a dialect's messages against the device, and prints a summary.
pub(super) fn check(file: &str, dialect: Dialect) -> Result<()> {
    let dialect = Arc::new(dialect);
    // This fails if the file names a command that the device does not have.
    Port::new(dialect.clone())?;
    println!("{file}: ok");
    describe(&dialect);
    Ok(())
}

fn describe(dialect: &Dialect) {
    let operations: Vec<_> = dialect.host().names().collect();
    let missing: Vec<_> = dialect.host().missing().collect();
    println!("  name        {}", dialect.name());
    println!("  framing     {}", dialect.framing());
    println!("  commands    {}", dialect.commands().count());
    println!("  host can    {}", operations.join(", "));
    let settings: Vec<_> = dialect.host().settings().map(|(name, _)| name).collect();
    if !settings.is_empty() {
        println!("  reads back  {}", settings.join(", "));
    }
    if !missing.is_empty() {
        println!("  host cannot {}", missing.join(", "));
    }
    let needed: Vec<_> = dialect.host().needed().collect();
    if !needed.is_empty() {
        println!("  no scan     without {}", needed.join(", "));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::profile::names_dialect;

    #[test]
    fn device_has_all_commands_of_the_shipped_dialects() {
        for name in Dialect::names() {
            check(name, Dialect::load(name).unwrap()).unwrap();
            assert!(names_dialect(name).unwrap(), "{name}");
        }
    }

    #[test]
    fn recognises_dialect_files_and_checks_their_commands() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("own.toml");
        let file = path.to_str().unwrap();
        let text = Dialect::text("okline").unwrap();
        let wrong = text.replace("SEQ:COUN?", "SEQ:MOON?");
        std::fs::write(&path, &wrong).unwrap();
        assert!(names_dialect(file).unwrap());
        let words = check(file, Dialect::load(file).unwrap()).unwrap_err();
        let line = 1 + wrong[..wrong.find("SEQ:MOON?").unwrap()]
            .matches('\n')
            .count();
        let place = format!("{file}:{line}: command[");
        assert!(words.to_string().starts_with(&place), "{words}");
        std::fs::write(&path, "name = \"profile\"\n").unwrap();
        assert!(!names_dialect(file).unwrap());
        assert!(!names_dialect("pmp-bench").unwrap());
        assert!(!names_dialect("no such file").unwrap());
    }
}
