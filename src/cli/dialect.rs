//! `phasma dialect`: lists the shipped dialects, prints one, checks files.

use crate::emulator::port::Port;
use crate::error::{Error, Result};
use crate::protocol::dialect::Dialect;
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
        Action::Show { name } => match Dialect::text(name) {
            Some(text) => print!("{text}"),
            None => {
                let names: Vec<_> = Dialect::names().collect();
                let found = "no shipped dialect";
                return Err(Error::input(name, found, names.join(", ")));
            }
        },
        Action::Check { file } => check(file, Dialect::load(file)?)?,
    }
    Ok(())
}

/// Checks a dialect's messages against the device, and says what it describes.
pub(super) fn check(file: &str, dialect: Dialect) -> Result<()> {
    let dialect = Arc::new(dialect);
    // The device knows whether it has the commands that the file names.
    Port::new(dialect.clone())?;
    let operations: Vec<_> = dialect.host().names().collect();
    let missing: Vec<_> = dialect.host().missing().collect();
    println!("{file}: ok");
    println!("  name        {}", dialect.name());
    println!("  framing     {}", dialect.framing());
    println!("  commands    {}", dialect.commands().count());
    println!("  host can    {}", operations.join(", "));
    if !missing.is_empty() {
        println!("  host cannot {}", missing.join(", "));
    }
    Ok(())
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
