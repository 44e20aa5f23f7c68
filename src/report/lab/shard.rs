//! Shards: parts of a study's trials that run in folders of their own, for example on the machines of a
//! cluster, and are joined in one folder afterwards.

use super::Study;
use super::folder::Folder;
use super::row::Row;
use super::runner::{about, columns, trials, whole};
use super::settings::Settings;
use phasmid_core::error::{Error, Result};
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Maximum number of shards.
const MOST: usize = 10_000;

/// One of several equal parts of a study's trials; by default all of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Counts from 0.
    index: usize,
    of: usize,
}

impl Default for Shard {
    fn default() -> Self {
        Self { index: 0, of: 1 }
    }
}

impl FromStr for Shard {
    type Err = Error;

    /// Reads `I/N`: the I-th of N shards, from 1.
    fn from_str(text: &str) -> Result<Self> {
        let numbers = text.split_once('/');
        let numbers = numbers.and_then(|(i, of)| Some((i.parse().ok()?, of.parse().ok()?)));
        match numbers {
            Some((i, of)) if (1..=MOST).contains(&of) && (1..=of).contains(&i) => {
                Ok(Self { index: i - 1, of })
            }
            _ => {
                let allowed = format!("I/N, such as 2/8, with I from 1 to N and N up to {MOST}");
                Err(Error::input("shard", text, allowed))
            }
        }
    }
}

impl Shard {
    /// Whether it has the trial with this index in the study's list.
    pub(super) fn has(self, trial: usize) -> bool {
        trial % self.of == self.index
    }
}

/// Takes over the rows and files of shards to the folder of the whole study, in which
/// [`run`](super::run()) then runs what is missing and makes the document. The folders of the shards are not changed.
///
/// # Errors
/// Returns an error if a folder belongs to another study, other settings or another program, or if a file
/// cannot be read or written.
pub fn join(
    study: &dyn Study,
    path: &Path,
    settings: &Settings,
    revision: &str,
    shards: &[PathBuf],
) -> Result<()> {
    let trials = trials(study, settings)?;
    let about = about(study, settings, revision);
    let columns = columns(study);
    let mut read = Vec::new();
    for path in shards {
        let (folder, found) = Folder::open(path)?;
        found.expect(&about, &path.display().to_string())?;
        read.push((folder.rows(&columns)?, folder));
    }
    let target = Folder::begin(path, &about)?;
    let mut rows = whole(target.rows(&columns)?, &trials).all;
    for (of_shard, folder) in read {
        let known: HashSet<String> = rows.iter().map(|row| row.get("trial").to_owned()).collect();
        let is_new = |row: &Row| !known.contains(row.get("trial"));
        let new = whole(of_shard, &trials).all.into_iter().filter(is_new);
        rows.extend(new);
        target.take_files(&folder)?;
    }
    target.writer(&columns, &rows).map(|_| ())
}
