//! `phasmid dialect`: lists the shipped dialects, prints one, checks files.

use phasmid_core::error::Result;
use phasmid_device::port::Port;
use phasmid_profile::{Profile, Station, StationDevice};
use phasmid_protocol::dialect::Dialect;
use phasmid_protocol::{Endpoints, endpoints};
use std::path::Path;
use std::sync::Arc;

/// List, show or check dialects of the control port.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// List the shipped dialects.
    List,
    /// Print the file of a shipped dialect, to start one's own from.
    Show {
        /// Its name.
        name: String,
    },
    /// Check a dialect file (or a shipped dialect) and say what it describes.
    Check {
        /// Path of a TOML file, or a shipped name.
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
            super::show("dialect", name, Dialect::text(name), Dialect::names())?
        }
        Action::Check { file } => check(file, Dialect::load(file)?)?,
    }
    Ok(())
}

/// The control port of a device as its profile has it.
///
/// # Errors
/// A dialect that is none, that does not go with the line, or that the device does not understand.
pub(super) fn port(profile: &Profile) -> Result<Port> {
    let dialect = profile.control.load_dialect(&profile.folder)?;
    Port::new(Arc::new(dialect))
}

/// A path that means the same wherever it is taken from; a name stays what it is.
pub(super) fn from_anywhere(name_or_path: &str) -> String {
    let absolute = std::path::absolute(name_or_path)
        .ok()
        .filter(|path| path.is_file() && !Dialect::names().any(|name| name == name_or_path));
    absolute
        .and_then(|path| path.to_str().map(str::to_owned))
        .unwrap_or_else(|| name_or_path.to_owned())
}

/// What a control port speaks: what is asked for, or what the `device.json` beside it says.
///
/// # Errors
/// What [`Dialect::load`] refuses.
pub(super) fn spoken(asked: Option<&str>, control: Option<&str>) -> Result<Option<Dialect>> {
    if let Some(asked) = asked {
        return Dialect::load(asked)
            .map(Some)
            .map_err(|e| e.at("--dialect"));
    }
    let Some(control) = control.map(Path::new) else {
        return Ok(None);
    };
    let folder = control.parent().unwrap_or(Path::new(""));
    let found = Endpoints::read(folder).ok();
    let own = found.filter(|found| found.control.file_name() == control.file_name());
    let Some(dialect) = own.and_then(|own| own.dialect) else {
        return Ok(None);
    };
    let place = folder.join(endpoints::FILE_NAME);
    let loaded = Dialect::load(&dialect).map_err(|e| e.at(place.display()));
    loaded.map(Some)
}

/// Has a device speak another dialect than its profile's, a path being relative to where the program
/// was started; `place` is where that is said.
pub(super) fn speak(profile: &mut Profile, name_or_path: &str, place: &str) {
    profile.control.dialect = from_anywhere(name_or_path);
    profile.control.places.dialect = place.to_owned();
}

/// The profile of a station's device, with the station's dialect where it names one.
///
/// # Errors
/// As for [`Profile::load`].
pub(super) fn profile_of(station: &Station, device: &StationDevice) -> Result<Profile> {
    let mut profile = Profile::load(&station.profile(device))?;
    if let Some(dialect) = station.dialect(device) {
        speak(&mut profile, &dialect, &device.dialect_place);
    }
    Ok(profile)
}

/// Checks a dialect's messages against the device, and says what it describes.
pub(super) fn check(file: &str, dialect: Dialect) -> Result<()> {
    let dialect = Arc::new(dialect);
    // The device knows whether it has the commands that the file names.
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
    fn the_device_has_what_the_shipped_dialects_name() {
        for name in Dialect::names() {
            check(name, Dialect::load(name).unwrap()).unwrap();
            assert!(names_dialect(name).unwrap(), "{name}");
        }
    }

    #[test]
    fn files_are_told_by_their_content_and_commands_by_the_device() {
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
