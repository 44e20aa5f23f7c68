//! `phasmid study`: runs a study, or says which there are.

use indicatif::{ProgressBar, ProgressStyle};
use phasmid_core::error::{Error, Result};
use phasmid_report::lab::{Settings, Study, Surroundings, run as run_study};
use phasmid_study::ALL;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Instant, UNIX_EPOCH};

/// Run a study: rows in CSV, tables, plots, and one page that shows them
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Which; without a name the studies are listed
    #[arg(requires = "out")]
    name: Option<String>,
    /// Folder for the rows and the report. A study that was interrupted goes on where it was
    #[arg(long, value_name = "DIR", requires = "name")]
    out: Option<PathBuf>,
    /// The form of less than a minute
    #[arg(long)]
    quick: bool,
    /// Only a part of the study, where it has parts; a part that it has not is answered with those that
    /// it has
    #[arg(long, value_name = "PART", requires = "name")]
    only: Option<String>,
    /// Seed of all noise and of everything that is drawn
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Trials side by side, timed ones apart; each has its share of the cores
    #[arg(long, value_name = "N", default_value_t = 1)]
    #[arg(value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: u16,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let (Some(name), Some(out)) = (&args.name, &args.out) else {
        for study in ALL {
            println!("{:<16}{}", study.name(), study.about());
        }
        return Ok(());
    };
    let study = find(name)?;
    let settings = Settings {
        quick: args.quick,
        seed: args.seed,
        only: args.only.clone(),
    };
    let begin = Instant::now();
    let revision = revision();
    let around = Surroundings {
        clock: &|| begin.elapsed(),
        jobs: usize::from(args.jobs),
        revision: &revision,
    };
    let bar = bar();
    let progress = |done: usize, all: usize, trial: &str| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
        bar.set_message(trial.to_owned());
    };
    let document = run_study(study, out, &settings, &around, &progress)?;
    bar.finish_and_clear();
    print!("{}", document.screen());
    println!("\n{}: rows.csv, tables.md, report.html", out.display());
    let failed: Vec<&str> = document
        .checks()
        .filter(|check| !check.passed())
        .map(|check| check.what.as_str())
        .collect();
    if failed.is_empty() {
        return Ok(());
    }
    let what = failed.join("; ");
    Err(Error::device(format!(
        "{} of {} checks failed: {what}",
        failed.len(),
        document.checks().count()
    )))
}

fn find(name: &str) -> Result<&'static dyn Study> {
    let found = ALL.iter().find(|study| study.name() == name);
    found.copied().ok_or_else(|| {
        let names: Vec<&str> = ALL.iter().map(|study| study.name()).collect();
        Error::input("study", name, names.join(", "))
    })
}

/// A bar on a terminal, nothing in a pipe.
fn bar() -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} {elapsed} {msg}");
    ProgressBar::new(1).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

/// Which program this is: the source's revision when it was built, and the checksum of its file, which
/// tells builds of one revision apart. The revision is what the build was told (`PHASMID_REVISION`),
/// or else where git says that the source's folder stood when the file was written there; nothing where
/// neither is known, as of a copy elsewhere.
fn revision() -> String {
    let program = std::env::current_exe().ok();
    let bytes = program.as_ref().and_then(|path| std::fs::read(path).ok());
    let built = option_env!("PHASMID_REVISION").map(str::to_owned);
    let built = built.or_else(|| head_at(&program?));
    let sum = bytes.map(|bytes| format!("program {:08x}", crc32fast::hash(&bytes)));
    let known: Vec<String> = built.into_iter().chain(sum).collect();
    match known.is_empty() {
        true => "unknown".to_owned(),
        // No comma: it stands in every row of a CSV.
        false => known.join(" "),
    }
}

/// The commit that the source's folder stood at when a file within it was written, by git's own log of
/// that.
fn head_at(program: &Path) -> Option<String> {
    if !program.starts_with(env!("CARGO_MANIFEST_DIR")) {
        return None;
    }
    let time = program.metadata().ok()?.modified().ok()?;
    let seconds = time.duration_since(UNIX_EPOCH).ok()?.as_secs();
    let head = format!("HEAD@{{{seconds} +0000}}");
    let told = Command::new("git")
        .args(["-C", env!("CARGO_MANIFEST_DIR"), "rev-parse", "--quiet"])
        .args(["--verify", "--short=12", &head])
        .output()
        .ok()?;
    let said = String::from_utf8_lossy(&told.stdout).trim().to_owned();
    (told.status.success() && !said.is_empty()).then_some(said)
}
