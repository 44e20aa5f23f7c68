//! `phasmid study`: runs a study, or lists the studies.

use super::launcher::Launcher;
use super::progress::ProgressLine;
use phasmid_core::Stop;
use phasmid_core::error::{Error, Result};
use phasmid_report::lab::{
    Settings, Shard, Study, Surroundings, join, run as run_study, run_shard,
};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Instant, UNIX_EPOCH};

/// Run a study, and write rows in CSV, tables, plots, and one page that shows them
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  phasmid study noise --quick --out noise\n  phasmid study noise --shard 1/2 --out noise-1\n  phasmid study noise --shard 2/2 --out noise-2\n  phasmid study noise --join noise-1 noise-2 --out noise-all"
)]
pub struct Args {
    /// Study to run; without a name, the studies are listed
    #[arg(requires = "out")]
    name: Option<String>,
    /// Folder for the rows and the report. An interrupted study continues where it stopped
    #[arg(long, value_name = "DIR", requires = "name")]
    out: Option<PathBuf>,
    /// Run the short form, which takes less than a minute
    #[arg(long)]
    quick: bool,
    /// Run only this part of the study, if it has parts; the error for an unknown part lists them
    #[arg(long, value_name = "PART", requires = "name")]
    only: Option<String>,
    /// Seed of all noise and of all random parameters
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of trials to run in parallel, each with its share of the cores; timed trials run alone
    #[arg(long, value_name = "N", default_value_t = 1)]
    #[arg(value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: u16,
    /// Run only the I-th of N equal parts of the trials, for example on N machines with a folder each;
    /// --join makes the report of all
    #[arg(long, value_name = "I/N", requires = "name", conflicts_with = "join")]
    shard: Option<Shard>,
    /// Read the rows of these shards' folders before running the remaining trials
    #[arg(long, value_name = "DIR", requires = "name", num_args = 1..)]
    join: Vec<PathBuf>,
}

/// Runs the command.
pub(super) fn run(args: &Args, launcher: &Launcher) -> Result<()> {
    let known = launcher.all_studies();
    let (Some(name), Some(out)) = (&args.name, &args.out) else {
        for study in known {
            println!("{:<16}{}", study.name(), study.about());
        }
        return Ok(());
    };
    let study = find(&known, name)?;
    let settings = Settings {
        quick: args.quick,
        seed: args.seed,
        only: args.only.clone(),
    };
    let begin = Instant::now();
    let revision = revision(launcher.program.as_deref());
    let around = Surroundings {
        clock: &|| begin.elapsed(),
        jobs: usize::from(args.jobs),
        revision: &revision,
    };
    let line = ProgressLine::new("trials");
    let progress = |done: usize, all: usize, trial: &str| {
        line.show(done, all);
        line.remark(trial.to_owned());
    };
    if let Some(shard) = args.shard {
        let stop = Stop::default();
        run_shard(study, out, &settings, &around, shard, &progress, &stop)?;
        drop(line);
        println!("{}: rows.csv of a shard", out.display());
        return Ok(());
    }
    if !args.join.is_empty() {
        let [done, all] = join(study, out, &settings, &revision, &args.join)?;
        println!(
            "{done} of {all} trials joined; the remaining {} run now",
            all - done
        );
    }
    let document = run_study(study, out, &settings, &around, &progress)?;
    drop(line);
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

fn find(known: &[&'static dyn Study], name: &str) -> Result<&'static dyn Study> {
    let found = known.iter().find(|study| study.name() == name);
    found.copied().ok_or_else(|| {
        let names: Vec<&str> = known.iter().map(|study| study.name()).collect();
        Error::input("study", name, names.join(", "))
    })
}

/// Identifies the program by the revision of its source and the checksum of its file, which
/// distinguishes builds of one revision. The revision is the value of `PHASMID_REVISION` at build
/// time, or else the commit that, by git's reflog, was checked out in the source folder when the
/// program's file was written. The revision is omitted if neither is known, for example if the file
/// was copied to another folder.
fn revision(program: Option<&Path>) -> String {
    let bytes = program.and_then(|path| std::fs::read(path).ok());
    let built = option_env!("PHASMID_REVISION").map(str::to_owned);
    let built = built.or_else(|| head_at(program?));
    let sum = bytes.map(|bytes| format!("program {:08x}", crc32fast::hash(&bytes)));
    let known: Vec<String> = built.into_iter().chain(sum).collect();
    match known.is_empty() {
        true => "unknown".to_owned(),
        // Do not separate by a comma, because the text is written into every row of a CSV file.
        false => known.join(" "),
    }
}

/// Returns the commit that was checked out in the source folder when a file in that folder was written,
/// according to git's reflog.
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
