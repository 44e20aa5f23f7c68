//! Runs the remaining trials of a study, and writes the files of its document.

use super::Study;
use super::document::{Block, Document};
use super::folder::{About, Folder, Writer};
use super::page::page;
use super::row::{Row, Rows};
use super::settings::{Settings, Surroundings};
use super::shard::Shard;
use super::trial::{Context, Trial};
use phasmid_core::Stop;
use phasmid_core::error::{Error, Result};
use std::collections::HashSet;
use std::env::consts::{ARCH, OS};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Called before the first trial and after every trial, with the number of finished trials, the number
/// of all trials, and the key of the trial that has finished, if any.
pub type Progress<'a> = &'a (dyn Fn(usize, usize, &str) + Sync);

/// Runs a study in a folder. Trials that have run there before are not run again.
///
/// # Errors
/// Returns an error if the folder belongs to another study, a trial fails, or a file cannot be written.
pub fn run(
    study: &dyn Study,
    path: &Path,
    settings: &Settings,
    around: &Surroundings<'_>,
    progress: Progress<'_>,
) -> Result<Document> {
    run_with_stop(study, path, settings, around, progress, &Stop::default())
}

/// Runs a study like [`run`], but another thread can end it early through `stop`. The rows of finished
/// trials stay in the folder, so that another run continues there.
///
/// # Errors
/// Returns [`Error::Interrupted`] if `stop` requests the end, as soon as the trials in progress have
/// ended, and the errors of [`run`]. A trial ends early if it passes on [`Context::stop`].
pub fn run_with_stop(
    study: &dyn Study,
    path: &Path,
    settings: &Settings,
    around: &Surroundings<'_>,
    progress: Progress<'_>,
    stop: &Stop,
) -> Result<Document> {
    let all = Shard::default();
    let (folder, trials) = run_trials(study, path, settings, around, all, progress, stop)?;
    let rows = whole(folder.rows(&columns(study))?, &trials);
    let document = document(study, &rows, &folder, settings)?;
    let made = made(&about(study, settings, around.revision));
    write(&document, &folder, &made)?;
    Ok(document)
}

/// Runs only the trials of a shard, and makes no document: [`join`](super::join()) copies their rows to
/// the folder of the whole study.
///
/// # Errors
/// Returns the errors of [`run_with_stop`].
pub fn run_shard(
    study: &dyn Study,
    path: &Path,
    settings: &Settings,
    around: &Surroundings<'_>,
    shard: Shard,
    progress: Progress<'_>,
    stop: &Stop,
) -> Result<()> {
    run_trials(study, path, settings, around, shard, progress, stop).map(|_| ())
}

/// Runs the trials of a shard that are not in the folder. Returns the folder and the trials of all
/// shards.
fn run_trials(
    study: &dyn Study,
    path: &Path,
    settings: &Settings,
    around: &Surroundings<'_>,
    shard: Shard,
    progress: Progress<'_>,
    stop: &Stop,
) -> Result<(Folder, Vec<Trial>)> {
    stop.check()?;
    let trials = trials(study, settings)?;
    let folder = Folder::begin(path, &about(study, settings, around.revision))?;
    distinct(&trials);
    let columns = columns(study);
    let done = whole(folder.rows(&columns)?, &trials);
    let known: HashSet<&str> = done.all.iter().map(|row| row.get("trial")).collect();
    let of_shard = trials.iter().enumerate().filter(|(i, _)| shard.has(*i));
    let of_shard: Vec<&Trial> = of_shard.map(|(_, trial)| trial).collect();
    let is_left = |trial: &&Trial| !known.contains(trial.key.as_str());
    let left: Vec<&Trial> = of_shard.iter().copied().filter(is_left).collect();
    let before = of_shard.len() - left.len();
    let writer = folder.writer(&columns, &done.all)?;
    let runner = Runner {
        settings,
        around,
        folder: &folder,
        columns: &columns,
        writer: Mutex::new(writer),
        done: AtomicUsize::new(before),
        all: of_shard.len(),
        progress,
        stop,
    };
    progress(before, of_shard.len(), "");
    runner.run(&left)?;
    Ok((folder, trials))
}

fn document(
    study: &dyn Study,
    rows: &Rows,
    folder: &Folder,
    settings: &Settings,
) -> Result<Document> {
    Ok(Document {
        title: study.title().to_owned(),
        asked: study.about().to_owned(),
        sections: study.sections(rows, folder, settings)?,
    })
}

/// Makes the document of a finished study from its folder. Also returns the folder, and a line that says
/// how the study was run.
///
/// # Errors
/// Returns an error if the folder contains no study, an unknown one, or an unfinished one.
pub fn read(studies: &[&dyn Study], path: &Path) -> Result<(Document, Folder, String)> {
    let (folder, about) = Folder::open(path)?;
    let known = studies.iter().find(|study| study.name() == about.study);
    let study = known.ok_or_else(|| {
        let names: Vec<&str> = studies.iter().map(|study| study.name()).collect();
        let place = format!("{}: study", path.display());
        Error::input(place, &about.study, names.join(", "))
    })?;
    let trials = trials(*study, &about.settings)?;
    let rows = whole(folder.rows(&columns(*study))?, &trials);
    let found: HashSet<&str> = rows.all.iter().map(|row| row.get("trial")).collect();
    if found.len() < trials.len() {
        return Err(Error::input(
            path.display(),
            format!("{} of {} trials", found.len(), trials.len()),
            "a finished study: run it again to continue it",
        ));
    }
    let document = document(*study, &rows, &folder, &about.settings)?;
    Ok((document, folder, made(&about)))
}

/// Writes `tables.md`, `report.html` and an `.svg` file for each figure.
///
/// # Errors
/// Returns an error if a file cannot be written or an image cannot be read.
pub fn write(document: &Document, folder: &Folder, made: &str) -> Result<()> {
    folder.replace("tables.md", document.markdown(true).as_bytes())?;
    for block in document.blocks() {
        if let Block::Figure(figure) = block {
            let drawing = figure.sheet.clone().into_file(&figure.caption);
            folder.replace(&format!("{}.svg", figure.name), drawing.as_bytes())?;
        }
    }
    let parts = [(document.clone(), folder, made.to_owned())];
    let html = page(&document.title, &parts)?;
    folder.replace("report.html", html.as_bytes())
}

struct Runner<'a> {
    settings: &'a Settings,
    around: &'a Surroundings<'a>,
    folder: &'a Folder,
    columns: &'a [&'static str],
    writer: Mutex<Writer>,
    done: AtomicUsize,
    all: usize,
    progress: Progress<'a>,
    stop: &'a Stop,
}

impl Runner<'_> {
    /// Runs the trials that may run in parallel, then the others one by one.
    fn run(&self, trials: &[&Trial]) -> Result<()> {
        let (alone, together): (Vec<&Trial>, Vec<&Trial>) =
            trials.iter().copied().partition(|trial| trial.alone);
        let jobs = self.around.jobs.clamp(1, together.len().max(1));
        if jobs == 1 {
            together.iter().try_for_each(|trial| self.one(trial))?;
        } else {
            self.side_by_side(&together, jobs)?;
        }
        alone.iter().try_for_each(|trial| self.one(trial))
    }

    /// Runs trials in parallel. Each job has its own thread pool, so that no trial waits for the work of
    /// another.
    fn side_by_side(&self, trials: &[&Trial], jobs: usize) -> Result<()> {
        let threads = (rayon::current_num_threads() / jobs).max(1);
        let next = AtomicUsize::new(0);
        let failed = Mutex::new(None);
        std::thread::scope(|scope| {
            for _ in 0..jobs {
                scope.spawn(|| {
                    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
                    let fail = |e: Error| {
                        let mut failed = failed.lock().unwrap_or_else(|e| e.into_inner());
                        failed.get_or_insert(e);
                        next.store(trials.len(), Ordering::Relaxed);
                    };
                    let pool = match pool {
                        Ok(pool) => pool,
                        Err(e) => return fail(Error::device(format!("threads: {e}"))),
                    };
                    while let Some(trial) = trials.get(next.fetch_add(1, Ordering::Relaxed)) {
                        if let Err(e) = pool.install(|| self.one(trial)) {
                            return fail(e);
                        }
                    }
                });
            }
        });
        let failed = failed.into_inner().unwrap_or_else(|e| e.into_inner());
        failed.map_or(Ok(()), Err)
    }

    /// Runs one trial and writes its rows, unless the run is asked to end.
    fn one(&self, trial: &Trial) -> Result<()> {
        self.stop.check()?;
        let asked = self.stop.times();
        let context = Context {
            settings: self.settings,
            seed: trial.seed,
            folder: self.folder,
            clock: self.around.clock,
            stop: self.stop,
        };
        let (rows, seconds) = context.timed(|| (trial.work)(&context));
        if self.stop.times() != asked {
            // Drop the rows: calls to which the trial has passed on the request to end may have returned
            // invalid results.
            return Err(Error::Interrupted);
        }
        let rows = rows.map_err(|e| Error::device(format!("trial {}: {e}", trial.key)))?;
        let parts = rows.len();
        let rows: Vec<Row> = rows
            .into_iter()
            .enumerate()
            .map(|(part, row)| self.complete(row, trial, (part, parts), seconds))
            .collect();
        let mut writer = self.writer.lock().unwrap_or_else(|e| e.into_inner());
        writer.append(&rows, self.columns)?;
        drop(writer);
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        (self.progress)(done, self.all, &trial.key);
        Ok(())
    }

    /// Returns a row with the common columns added.
    fn complete(&self, row: Row, trial: &Trial, of: (usize, usize), seconds: f64) -> Row {
        for name in row.names() {
            assert!(self.columns.contains(&name), "no column {name}");
        }
        let backend = match row.get("backend") {
            "" => "cpu".to_owned(),
            known => known.to_owned(),
        };
        row.text("trial", &trial.key)
            .number("part", of.0 as f64)
            .number("parts", of.1 as f64)
            .text("seed", &trial.seed.to_string())
            .text("backend", &backend)
            .text("version", env!("CARGO_PKG_VERSION"))
            .text("revision", self.around.revision)
            .text("target", &format!("{}-{}", ARCH, OS))
            .number("threads", rayon::current_num_threads() as f64)
            .number("seconds", (seconds * 1e6).round() * 1e-6)
    }
}

/// Returns all trials, or only the trials of the requested part.
pub(super) fn trials(study: &dyn Study, settings: &Settings) -> Result<Vec<Trial>> {
    let mut trials = study.trials(settings)?;
    if let Some(only) = &settings.only {
        let parts = study.parts();
        if !parts.contains(&only.as_str()) {
            let allowed = match parts {
                [] => format!("no --only: {} has no parts that run alone", study.name()),
                _ => parts.join(", "),
            };
            return Err(Error::input("--only", only, allowed));
        }
        let prefix = format!("{only}/");
        trials.retain(|trial| trial.key.starts_with(&prefix));
    }
    Ok(trials)
}

/// Returns the rows of complete trials, in the order of the trials. A trial is complete if all its rows
/// are present.
pub(super) fn whole(rows: Vec<Row>, trials: &[Trial]) -> Rows {
    let mut all = Vec::new();
    for trial in trials {
        let of: Vec<&Row> = rows
            .iter()
            .filter(|row| row.get("trial") == trial.key)
            .collect();
        let parts = of.first().map_or(0, |row| row.value("parts") as usize);
        if parts > 0 && of.len() == parts {
            all.extend(of.into_iter().cloned());
        }
    }
    Rows { all }
}

pub(super) fn columns(study: &dyn Study) -> Vec<&'static str> {
    Row::COMMON.iter().chain(study.columns()).copied().collect()
}

/// Checks that the keys of the trials are unique; trials with equal keys would be taken for one trial.
fn distinct(trials: &[Trial]) {
    let mut keys = HashSet::new();
    for trial in trials {
        assert!(keys.insert(&trial.key), "two trials {}", trial.key);
    }
}

pub(super) fn about(study: &dyn Study, settings: &Settings, revision: &str) -> About {
    About {
        made_by: concat!("phasmid study ", env!("CARGO_PKG_VERSION")).to_owned(),
        study: study.name().to_owned(),
        settings: settings.clone(),
        revision: revision.to_owned(),
    }
}

fn made(about: &About) -> String {
    let quick = if about.settings.quick { " --quick" } else { "" };
    let only = about.settings.only.as_ref();
    let only = only.map_or_else(String::new, |part| format!(" --only {part}"));
    format!(
        "phasmid study {}{quick}{only} --seed {} ({}, revision {})",
        about.study, about.settings.seed, about.made_by, about.revision
    )
}
