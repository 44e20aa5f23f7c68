//! `phasmid faults`: the kinds of faults, schedules of them, and what the host makes of each.

use phasmid_core::error::{Error, Result};
use phasmid_core::new_file;
use phasmid_protocol::faults::{Kind, Schedule, Side};
use phasmid_study::faults::{Table, markdown, tables};
use std::io::Write;
use std::path::{Path, PathBuf};

/// List the faults that can be injected, check schedules of them, and try each on the host
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// List the kinds of faults with their parameters.
    List,
    /// Check a schedule and say what it holds.
    Check {
        /// A TOML file, as `phasmid serve --faults` takes it.
        file: PathBuf,
    },
    /// Try every fault on the host, in memory and in virtual time: does it recover, report, or go on
    /// with a wrong cloud? Exit status 1 if it ever does the last.
    Matrix {
        /// Write the tables as Markdown.
        #[arg(long, value_name = "FILE")]
        out: Option<PathBuf>,
        /// Overwrite an existing file.
        #[arg(long, requires = "out")]
        force: bool,
        /// Strike at each frame and message in turn, not at six of them: minutes.
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
    let tables = tables(each, &|what| super::step(what))?;
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
        "{wrong} of {scans} scans gave a wrong cloud and nobody said so; the first: {}",
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
            println!(
                "{:<18}  {}: {}; {} when absent",
                "", parameter.name, parameter.allowed, parameter.default
            );
        }
    }
    println!();
    println!("when = {{ ... }}: all that is said must hold");
    for (name, about) in [
        (
            "frames",
            "\"triggered\" (when absent), \"free\" or \"all\": which frames count",
        ),
        (
            "command",
            "a part of the command that a message is or answers, or of the last one",
        ),
        ("window_s", "[from, until], seconds of device time"),
        ("nth", "the nth of those that count so far, from 1"),
        ("every", "every so many of them; with nth from that one on"),
        (
            "probability",
            "0 to 1 of what is left, by the schedule's seed",
        ),
    ] {
        println!("  {name:<16}{about}");
    }
    println!(
        "on = \"camera\" or \"port\", device = NAME, times = N: see above, whose, at most how often"
    );
}

/// A fault in words: its fields as they are written, `what` first.
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
