//! A study's folder: `study.json` identifies the study, `rows.csv` grows trial by trial, and `files/`
//! contains what trials write for the document.

use super::csv;
use super::row::Row;
use super::settings::Settings;
use phasmid_core::error::{Error, Result};
use phasmid_core::file;
use phasmid_core::new_file::{is_unfinished, replace};
use serde::{Deserialize, Serialize};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::Write;
use std::path::{Path, PathBuf};

const ABOUT: &str = "study.json";
pub(super) const ROWS: &str = "rows.csv";
const FILES: &str = "files";
/// Maximum size of a file that is read; more than any study writes.
const MOST_BYTES: u64 = 256 << 20;

/// Contents of `study.json`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct About {
    /// `phasmid study` and its version.
    pub(super) made_by: String,
    pub(super) study: String,
    #[serde(flatten)]
    pub(super) settings: Settings,
    /// Revision of the source that the program was built from, and the program's checksum.
    pub(super) revision: String,
}

/// The folder of one study.
pub struct Folder {
    path: PathBuf,
    /// Lock that is held while a study runs in the folder.
    _lock: Option<File>,
}

impl Folder {
    /// Prepares a folder for a study: an empty or new one, or one in which the same study was started
    /// with the same settings by the same program.
    ///
    /// # Errors
    /// Returns an error if the folder contains anything else, is in use, or cannot be written.
    pub(super) fn begin(path: &Path, about: &About) -> Result<Self> {
        let place = || format!("--out {}", path.display());
        if path.exists() && !path.is_dir() {
            let allowed = "a folder, or a path where one can be created";
            return Err(Error::input(place(), "a file", allowed));
        }
        fs::create_dir_all(path).map_err(|e| Error::io(path, e))?;
        let mut folder = Self {
            path: path.to_owned(),
            _lock: None,
        };
        let known = path.join(ABOUT);
        if known.exists() {
            folder.about()?.expect(about, &place())?;
            folder.lock()?;
            return Ok(folder);
        }
        for entry in fs::read_dir(path).map_err(|e| Error::io(path, e))? {
            let entry = entry.map_err(|e| Error::io(path, e))?;
            // A study that was killed at its start left this file.
            if is_unfinished(&entry.file_name()) {
                continue;
            }
            return Err(Error::input(
                place(),
                format!(
                    "{}, which no study has created",
                    entry.file_name().display()
                ),
                "an empty or new folder, or one in which this study was started",
            ));
        }
        let json = serde_json::to_string_pretty(about).expect("words and numbers");
        folder.replace(ABOUT, format!("{json}\n").as_bytes())?;
        folder.lock()?;
        Ok(folder)
    }

    /// Locks the folder until this value is dropped or the process ends, for whatever reason.
    fn lock(&mut self) -> Result<()> {
        let path = self.path.join(ABOUT);
        let file = File::open(&path).map_err(|e| Error::io(&path, e))?;
        match file.try_lock() {
            Ok(()) => {
                self._lock = Some(file);
                Ok(())
            }
            Err(TryLockError::WouldBlock) => Err(Error::input(
                format!("--out {}", self.path.display()),
                "a folder in which this study is already running",
                "another folder, or this one after that run has ended",
            )),
            Err(TryLockError::Error(e)) => Err(Error::io(&path, e)),
        }
    }

    /// Opens a folder in which a study was run.
    ///
    /// # Errors
    /// Returns an error if the folder does not exist or contains no study.
    pub(super) fn open(path: &Path) -> Result<(Self, About)> {
        let folder = Self {
            path: path.to_owned(),
            _lock: None,
        };
        if !path.join(ABOUT).is_file() {
            return Err(Error::input(
                path.display(),
                format!("no {ABOUT}"),
                "the --out folder of a phasmid study",
            ));
        }
        let about = folder.about()?;
        Ok((folder, about))
    }

    /// Returns the path of the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn about(&self) -> Result<About> {
        let path = self.path.join(ABOUT);
        let bytes = file::read(&path, 1 << 16)?;
        serde_json::from_slice(&bytes).map_err(|e| {
            let allowed = "JSON with made_by, study, quick, seed and revision, and optionally only";
            Error::input(path.display(), e.to_string(), allowed)
        })
    }

    /// Reads all rows in the order of the file. Ignores an incomplete last line, which a killed run
    /// leaves behind.
    ///
    /// # Errors
    /// Returns an error if the file contains anything but rows with these columns.
    pub(super) fn rows(&self, columns: &[&str]) -> Result<Vec<Row>> {
        let path = self.path.join(ROWS);
        if !path.exists() {
            return Ok(Vec::new());
        }
        let bytes = file::read(&path, MOST_BYTES)?;
        let text = String::from_utf8(bytes)
            .map_err(|_| Error::input(path.display(), "invalid UTF-8", "rows"))?;
        let mut rows = Vec::new();
        let whole = text
            .split_inclusive('\n')
            .filter(|line| line.ends_with('\n'));
        for (i, line) in whole.enumerate() {
            let line = line.trim_end_matches('\n');
            let refuse = |allowed: String| {
                let place = format!("{}, line {}", path.display(), i + 1);
                Error::input(place, line.chars().take(80).collect::<String>(), allowed)
            };
            if i == 0 {
                if csv::cells(line).is_none_or(|cells| cells != columns) {
                    return Err(refuse(columns.join(",")));
                }
                continue;
            }
            let row = csv::row_of(line, columns);
            rows.push(row.ok_or_else(|| refuse(format!("{} cells", columns.len())))?);
        }
        Ok(rows)
    }

    /// Rewrites the file of rows with only the rows in `done`, without the partial line or trial of a
    /// killed run, and opens it for appending.
    pub(super) fn writer(&self, columns: &[&str], done: &[Row]) -> Result<Writer> {
        let mut text = csv::line(columns.iter().copied());
        for row in done {
            text += &csv::row_line(row, columns);
        }
        self.replace(ROWS, text.as_bytes())?;
        let path = self.path.join(ROWS);
        let file = OpenOptions::new().append(true).open(&path);
        let file = file.map_err(|e| Error::io(&path, e))?;
        Ok(Writer { path, file })
    }

    /// Writes a file atomically.
    pub(super) fn replace(&self, name: &str, bytes: &[u8]) -> Result<()> {
        replace(&self.path.join(name), |out| out.write_all(bytes))
    }

    /// Returns the folder for the files of trials.
    pub fn files(&self) -> PathBuf {
        self.path.join(FILES)
    }

    /// Returns a path at which a trial may write a file for itself or for the document; `name` has no
    /// folders. Creates the folder for the files of trials.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be created.
    pub fn place(&self, name: &str) -> Result<PathBuf> {
        let folder = self.files();
        match fs::create_dir(&folder) {
            // Accept an existing folder, but not a link to one.
            Err(_) if folder.symlink_metadata().is_ok_and(|it| it.is_dir()) => {}
            made => made.map_err(|e| Error::io(&folder, e))?,
        }
        Ok(folder.join(name))
    }

    /// Writes a file for the document; `name` has no folders.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub fn leave(&self, name: &str, bytes: &[u8]) -> Result<()> {
        replace(&self.place(name)?, |out| out.write_all(bytes))
    }

    /// Copies the trials' files from the folder `other` into this folder. Existing files are not
    /// overwritten.
    pub(super) fn take_files(&self, other: &Self) -> Result<()> {
        let from = other.files();
        if !from.is_dir() {
            return Ok(());
        }
        for entry in fs::read_dir(&from).map_err(|e| Error::io(&from, e))? {
            let entry = entry.map_err(|e| Error::io(&from, e))?;
            // A folder belongs to a trial in progress.
            if !entry.file_type().is_ok_and(|kind| kind.is_file()) {
                continue;
            }
            let name = entry.file_name();
            let (Some(name), false) = (name.to_str(), is_unfinished(&name)) else {
                continue;
            };
            if !self.place(name)?.exists() {
                self.leave(name, &other.left(name)?)?;
            }
        }
        Ok(())
    }

    /// Reads a file that a trial has written.
    ///
    /// # Errors
    /// Returns an error if the file does not exist or cannot be read.
    pub fn left(&self, name: &str) -> Result<Vec<u8>> {
        file::read(&self.files().join(name), MOST_BYTES)
    }
}

/// Appends rows.
pub(super) struct Writer {
    path: PathBuf,
    file: File,
}

impl Writer {
    /// Writes the rows of a trial at once.
    pub(super) fn append(&mut self, rows: &[Row], columns: &[&str]) -> Result<()> {
        let text: String = rows.iter().map(|row| csv::row_line(row, columns)).collect();
        let written = self.file.write_all(text.as_bytes());
        written.map_err(|e| Error::io(&self.path, e))
    }
}

impl About {
    /// Refuses a folder of another study, other settings or another program.
    pub(super) fn expect(&self, wanted: &Self, place: &str) -> Result<()> {
        match self.is_of(wanted) {
            true => Ok(()),
            false => Err(Error::input(
                place,
                described(self),
                format!("{} to continue it, or another folder", described(wanted)),
            )),
        }
    }

    /// Whether the rows of this run and of the run `other` may be in one file. Programs with equal
    /// checksums are the same, even if their commits differ: a copy, or another user, may not know the
    /// commit.
    fn is_of(&self, other: &Self) -> bool {
        let program = |about: &Self| {
            let sum = about.revision.rsplit_once("program ");
            sum.map(|(_, sum)| sum.to_owned())
        };
        let same = program(self).is_some() && program(self) == program(other);
        let revision = match same {
            true => other.revision.clone(),
            false => self.revision.clone(),
        };
        Self {
            revision,
            ..self.clone()
        } == *other
    }
}

fn described(about: &About) -> String {
    let only = about.settings.only.as_ref();
    format!(
        "study {}{}{}, seed {}, by {} at revision {}",
        about.study,
        if about.settings.quick { " --quick" } else { "" },
        only.map_or_else(String::new, |part| format!(" --only {part}")),
        about.settings.seed,
        about.made_by,
        about.revision
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn program_is_identified_by_checksum_not_by_commit() {
        let at = |revision: &str| About {
            made_by: "phasmid 0".to_owned(),
            study: "noise".to_owned(),
            settings: Settings {
                quick: true,
                seed: 1,
                only: None,
            },
            revision: revision.to_owned(),
        };
        let begun = at("0123456789ab program 3cc4da00");
        assert!(begun.is_of(&begun));
        assert!(begun.is_of(&at("program 3cc4da00")));
        assert!(!begun.is_of(&at("0123456789ab program 3cc4da01")));
        let mut other = at("program 3cc4da00");
        other.settings.seed = 2;
        assert!(!begun.is_of(&other));
        // If the checksum is unknown, the revisions must be equal.
        assert!(at("unknown").is_of(&at("unknown")));
        assert!(!at("unknown").is_of(&at("0123456789ab")));
    }
}
