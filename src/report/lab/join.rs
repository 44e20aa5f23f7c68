//! Joins shards in one folder.

use super::Study;
use super::folder::{Folder, ROWS};
use super::row::Row;
use super::runner::{about, columns, trials, whole};
use super::settings::Settings;
use phasmid_core::error::{Error, Result};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Copies the rows and files of shards to the folder of the whole study, where [`run`](super::run())
/// then runs the missing trials and makes the document. The folders of the shards are not changed.
/// Returns the number of trials whose rows are present, and the number of all trials.
///
/// # Errors
/// Returns an error if a folder belongs to another study, other settings or another program, or has no
/// rows, or if a file cannot be read or written.
pub fn join(
    study: &dyn Study,
    path: &Path,
    settings: &Settings,
    revision: &str,
    shards: &[PathBuf],
) -> Result<[usize; 2]> {
    let trials = trials(study, settings)?;
    let about = about(study, settings, revision);
    let columns = columns(study);
    let mut read = Vec::new();
    for path in shards {
        let (folder, found) = Folder::open(path)?;
        found.expect(&about, &path.display().to_string())?;
        if !path.join(ROWS).is_file() {
            let place = path.display();
            return Err(Error::input(
                place,
                format!("no {ROWS}"),
                "the folder of a shard",
            ));
        }
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
    let done: HashSet<&str> = rows.iter().map(|row| row.get("trial")).collect();
    target.writer(&columns, &rows)?;
    Ok([done.len(), trials.len()])
}
