//! The commands in groups, as the help lists them; help of subcommands, completions for shells, and
//! man pages.

use clap::ArgMatches;
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file;
use phasmid_core::output_folder::OutputFolder;
use std::ffi::{OsStr, OsString};
use std::io::Write;
use std::path::PathBuf;

/// All commands, in groups with a title.
const GROUPS: [(&str, &[&str]); 8] = [
    ("Start here", &["demo"]),
    (
        "Devices",
        &[
            "serve", "profile", "sequence", "scene", "dialect", "faults", "plan", "bench",
        ],
    ),
    (
        "Host",
        &[
            "scan",
            "camera",
            #[cfg(feature = "console")]
            "console",
        ],
    ),
    ("Calibration", &["calibrate", "board"]),
    ("Radiotherapy", &["patient", "locate", "track"]),
    ("Data", &["decode", "compare", "record", "replay"]),
    ("Studies", &["study", "report"]),
    (
        "This machine",
        &[
            "doctor",
            #[cfg(feature = "schema")]
            "schema",
            "completions",
            "man",
        ],
    ),
];

/// Write completions for a shell to standard output
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  phasmid completions bash > phasmid.bash")]
pub(super) struct CompletionsArgs {
    /// Shell to complete for
    shell: clap_complete::Shell,
}

/// Write man pages, one for each command
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  phasmid man --out man1")]
pub(super) struct ManArgs {
    /// Folder for the pages; it is made if it does not exist
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Overwrite existing pages
    #[arg(long)]
    force: bool,
}

/// The command line.
pub(super) struct CommandLine(clap::Command);

impl CommandLine {
    /// Parses arguments, of which the first is the program's name.
    ///
    /// # Errors
    /// Returns a usage error, or the text of the help or version.
    pub(super) fn parse(self, mut arguments: Vec<OsString>) -> Result<ArgMatches, clap::Error> {
        // `clap` takes each argument after the subcommand `help` for the name of a command.
        if let Some(help) = self.place_of_help(&arguments) {
            let mut place = 0..;
            arguments.retain(|word| place.next() <= Some(help) || !is_help_option(word));
        }
        self.0.try_get_matches_from(arguments)
    }

    /// Returns the index of the subcommand `help`, if the arguments contain it.
    fn place_of_help(&self, arguments: &[OsString]) -> Option<usize> {
        let mut command = &self.0;
        for (place, word) in arguments.iter().enumerate().skip(1) {
            if word == "help" && command.has_subcommands() {
                return Some(place);
            }
            command = command.find_subcommand(word)?;
        }
        None
    }
}

fn is_help_option(word: &OsStr) -> bool {
    word == "--help" || word == "-h"
}

/// Returns the command line of a program, with a help that lists its commands in groups.
pub(super) fn command(command: clap::Command) -> CommandLine {
    let about = |name: &str| {
        let about = command.find_subcommand(name).and_then(|c| c.get_about());
        about.map(ToString::to_string).unwrap_or_default()
    };
    let mut list = String::new();
    for (group, names) in GROUPS {
        list += &format!("{group}:\n");
        for name in names {
            list += &format!("  {name:<13}{}\n", about(name));
        }
        list.push('\n');
    }
    list += "Start with `phasmid demo`; `phasmid COMMAND --help` explains a command.";
    let command = with_negative_numbers(command);
    let template = "{about}\n\n{usage-heading} {usage}\n\nOptions:\n{options}{after-help}\n";
    CommandLine(command.help_template(template).after_help(list))
}

/// Lets every option take a negative number, so that `--seed -1` names the allowed range instead of
/// an unknown option `-1`.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let takes = |arg: clap::Arg| match arg.get_action().takes_values() {
        true => arg.allow_negative_numbers(true),
        false => arg,
    };
    command
        .mut_args(takes)
        .mut_subcommands(with_negative_numbers)
}

pub(super) fn completions(args: &CompletionsArgs, mut command: clap::Command) -> Result<()> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut command, "phasmid", &mut text);
    print!("{}", String::from_utf8_lossy(&text));
    Ok(())
}

pub(super) fn man(args: &ManArgs, mut command: clap::Command) -> Result<()> {
    command.build();
    let mut pages = Vec::new();
    let mut open = vec![(command, "phasmid".to_owned())];
    while let Some((command, name)) = open.pop() {
        for inner in command.get_subcommands().filter(|c| c.get_name() != "help") {
            open.push((inner.clone(), format!("{name}-{}", inner.get_name())));
        }
        let mut page = Vec::new();
        let rendered = clap_mangen::Man::new(command.name(name.clone())).render(&mut page);
        rendered.map_err(|e| Error::io(&args.out, e))?;
        pages.push((format!("{name}.1"), page));
    }
    new_file::check_folder(&args.out, pages.iter().map(|(file, _)| file), args.force)?;
    let folder = OutputFolder::create(&args.out, args.force)?;
    for (file, page) in &pages {
        new_file::replace(&folder.draft().join(file), |out| out.write_all(page))?;
    }
    folder.finish(pages.iter().map(|(file, _)| file), None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::Cli;
    use clap::CommandFactory;

    #[test]
    fn every_command_is_in_one_group() {
        let mut grouped: Vec<&str> = GROUPS
            .iter()
            .flat_map(|(_, names)| *names)
            .copied()
            .collect();
        grouped.sort_unstable();
        let command = Cli::command();
        let mut names: Vec<&str> = command
            .get_subcommands()
            .map(clap::Command::get_name)
            .collect();
        names.sort_unstable();
        assert_eq!(grouped, names);
    }

    #[test]
    fn help_of_a_command_takes_the_option_help() {
        let answer = |line: &str| {
            let arguments = line.split(' ').map(OsString::from).collect();
            command(Cli::command()).parse(arguments).unwrap_err()
        };
        for (line, same) in [
            ("phasmid help --help", "phasmid --help"),
            ("phasmid help -h scan", "phasmid scan --help"),
            ("phasmid profile help --help", "phasmid profile --help"),
            ("phasmid record help info -h", "phasmid record info --help"),
            ("phasmid help faults list", "phasmid faults list --help"),
        ] {
            let (one, other) = (answer(line), answer(same));
            assert_eq!(one.kind(), clap::error::ErrorKind::DisplayHelp, "{line}");
            assert_eq!(one.to_string(), other.to_string(), "{line}");
        }
        // In this command line `help` is the name of a profile. No such profile exists.
        let show = answer("phasmid profile show help --help");
        let usage = "profile show [OPTIONS] <NAME>";
        assert!(show.to_string().contains(usage), "{show}");
        let unknown = answer("phasmid profile help moon --help").to_string();
        assert!(unknown.contains("'moon'"), "{unknown}");
    }

    #[test]
    fn negative_numbers_are_values() {
        let parse = |line: &str| {
            let arguments = line.split(' ').map(OsString::from).collect();
            command(Cli::command()).parse(arguments)
        };
        parse("phasmid serve --motion-tolerance -1").unwrap();
        let seed = parse("phasmid demo --seed -1").unwrap_err().to_string();
        assert!(seed.contains("invalid value '-1' for '--seed"), "{seed}");
        let flag = parse("phasmid demo -1").unwrap_err().to_string();
        assert!(flag.contains("unexpected argument '-1'"), "{flag}");
    }

    #[test]
    fn man_pages_are_written_for_all_commands_and_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let args = ManArgs {
            out: folder.path().join("man1"),
            force: false,
        };
        man(&args, Cli::command()).unwrap();
        let page = |name: &str| std::fs::read_to_string(args.out.join(name)).unwrap();
        assert!(page("phasmid.1").contains("phasmid\\-demo"));
        assert!(page("phasmid-profile-check.1").contains("SYNOPSIS"));
        assert!(man(&args, Cli::command()).is_err());
    }
}
