//! `phasmid report`: joins studies into one page.

use super::launcher::Launcher;
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file;
use phasmid_report::lab::{page, read};
use std::io::Write;
use std::path::PathBuf;

/// Join the results of studies into one HTML page
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  phasmid report noise stability --out report.html")]
pub struct Args {
    /// Output folders of `phasmid study`
    #[arg(required = true, value_name = "DIR")]
    studies: Vec<PathBuf>,
    /// HTML page to write
    #[arg(long, value_name = "FILE", default_value = "phasmid-report.html")]
    out: PathBuf,
    /// Overwrite an existing file
    #[arg(long)]
    force: bool,
}

pub(super) fn run(args: &Args, launcher: &Launcher) -> Result<()> {
    new_file::check(&args.out, args.force)?;
    let known = launcher.all_studies();
    let read: Result<Vec<_>> = args.studies.iter().map(|path| read(&known, path)).collect();
    let read = read?;
    let parts: Vec<_> = read
        .iter()
        .map(|(document, folder, made)| (document.clone(), folder, made.clone()))
        .collect();
    let html = page("Studies of Phasmid", &parts)?;
    new_file::write(&args.out, args.force, |out| out.write_all(html.as_bytes()))?;
    let (mut failed, mut all) = (0, 0);
    for (document, ..) in &parts {
        let checks: Vec<_> = document.checks().collect();
        let passed = checks.iter().filter(|check| check.passed()).count();
        println!(
            "{}: {passed} of {} checks passed",
            document.title,
            checks.len()
        );
        failed += checks.len() - passed;
        all += checks.len();
    }
    println!("{}", args.out.display());
    match failed {
        0 => Ok(()),
        _ => Err(Error::device(format!("{failed} of {all} checks failed"))),
    }
}
