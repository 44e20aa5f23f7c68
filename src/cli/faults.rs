//! `phasma faults`: the kinds of faults, and schedules of them.

use crate::error::Result;
use crate::profile::faults::{Kind, Schedule, Side};
use std::path::PathBuf;

/// List the faults that can be injected, and check schedules of them
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
        /// A TOML file, as `phasma serve --faults` takes it.
        file: PathBuf,
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
    }
    Ok(())
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
