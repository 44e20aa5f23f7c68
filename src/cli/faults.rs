//! `phasmid faults`: lists the kinds of faults, checks schedules, and tests the host against each fault.

use phasmid_core::error::{Error, Result};
use phasmid_core::new_file;
use phasmid_protocol::faults::{Kind, Schedule, Side};
use phasmid_study::faults::{Table, markdown, tables};
use std::io::Write;
use std::path::{Path, PathBuf};

/// List the faults that can be injected, check schedules of them, and test the host against each
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// List the kinds of faults with their parameters.
    #[command(after_help = "Example:\n  phasmid faults list")]
    List,
    /// Check a schedule of faults and summarise it.
    #[command(after_help = "Example:\n  phasmid faults check faults.toml")]
    Check {
        /// Path of a TOML file, as for `phasmid serve --faults`.
        file: PathBuf,
    },
    /// Test the host against every fault, in memory and in virtual time: does it recover, report an
    /// error, or return a wrong cloud? Exit status 1 if any scan returns a wrong cloud.
    #[command(after_help = "Example:\n  phasmid faults matrix --out matrix.md")]
    Matrix {
        /// Write the tables to this Markdown file.
        #[arg(long, value_name = "FILE")]
        out: Option<PathBuf>,
        /// Overwrite an existing file.
        #[arg(long, requires = "out")]
        force: bool,
        /// Inject at each frame and message in turn, not only at six of them; takes minutes.
        #[arg(long)]
        each: bool,
        /// Print the tables as JSON.
        #[arg(long)]
        json: bool,
    },
}

pub(super) fn run(args: &Args) -> Result<()> {
    match &args.action {
        Action::List => list(),
        Action::Check { file } => {
            let schedule = Schedule::read(file)?;
            println!("{}: ok", file.display());
            println!("  seed  {}", schedule.seed);
            for (number, fault) in (1..).zip(&schedule.fault) {
                let words = serde_json::to_value(fault).map_or(String::new(), |json| told(&json));
                println!("  {number:<4}  {words}");
            }
        }
        Action::Matrix {
            out,
            force,
            each,
            json,
        } => return matrix(out.as_deref(), *force, *each, *json),
    }
    Ok(())
}

fn matrix(out: Option<&Path>, force: bool, each: bool, json: bool) -> Result<()> {
    if let Some(path) = out {
        new_file::check(path, force)?;
    }
    let tables = tables(each, &|what| super::output::step(what))?;
    let text = markdown(&tables);
    if let Some(path) = out {
        new_file::write(path, force, |out| out.write_all(text.as_bytes()))?;
    }
    match json {
        true => println!("{}", serde_json::json!({ "tables": tables })),
        false => print!("{text}"),
    }
    let (scans, wrong) = tables.iter().fold((0, 0), |(scans, wrong), table| {
        (scans + table.scans(), wrong + table.wrong())
    });
    if wrong == 0 {
        return Ok(());
    }
    let first = tables.iter().flat_map(Table::wrongs).next();
    Err(Error::device(format!(
        "{wrong} of {scans} scans returned a wrong cloud without an error; the first: {}",
        first.unwrap_or_default()
    )))
}

fn list() {
    for kind in Kind::ALL {
        let side = match kind.sides {
            [Side::Camera] => "camera",
            [Side::Port] => "port",
            [Side::Camera, ..] => "camera or port",
            _ => "port or camera",
        };
        println!("{:<18}{} [{side}]", kind.name, kind.about);
        for parameter in kind.parameters {
            let default = kind.default(parameter.name);
            let default = default.map_or(String::new(), |value| format!(", {value} when absent"));
            println!(
                "{:<18}  {}: {}{default}: {}",
                "",
                parameter.name,
                parameter.allowed(),
                parameter.about
            );
        }
    }
    println!();
    println!("when = {{ ... }}: all given conditions must hold");
    for (name, about) in [
        (
            "frames",
            "frames to count: \"triggered\" (when absent), \"free\" or \"all\"",
        ),
        (
            "command",
            "text in the message, in the command it answers, or in the last command before a frame",
        ),
        ("window_s", "[from, until], seconds of device time"),
        (
            "nth",
            "the nth frame or message that meets the conditions above, from 1",
        ),
        (
            "every",
            "every nth such frame or message; with nth, beginning at that one",
        ),
        (
            "probability",
            "0 to 1, for each remaining frame or message; drawn from the schedule's seed",
        ),
    ] {
        println!("  {name:<16}{about}");
    }
    println!(
        "on = \"camera\" or \"port\" (see above), device = NAME (only this device), times = N (at most)"
    );
}

/// Describes a fault: the value of `what`, then the other fields as in the file.
fn told(json: &serde_json::Value) -> String {
    let Some(fields) = json.as_object() else {
        return json.to_string();
    };
    let what = fields.get("what").and_then(|what| what.as_str());
    let others = fields.iter().filter(|(name, _)| *name != "what");
    let mut words = what.unwrap_or_default().to_owned();
    for (name, value) in others {
        words.push_str(&match value {
            serde_json::Value::Object(_) => format!("  {name} {{ {} }}", told(value).trim()),
            _ => format!("  {name} = {value}"),
        });
    }
    words
}
