//! Collects the images of a folder and its subfolders.

use super::slice::Slice;
use phasmid_core::error::{Error, Result};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Maximum number of files; a 4D-CT has about 1500.
const MOST_FILES: usize = 20_000;
/// Maximum folder depth: patient, study, series, and some levels added by programs.
const DEEPEST: usize = 8;

/// Reads the headers of all images, in the order of their paths; at least one. Hidden files and a
/// `DICOMDIR` are ignored, every other file must be a CT image.
pub(super) fn slices(folder: &Path) -> Result<Vec<Slice>> {
    let mut files = Vec::new();
    collect(folder, 0, &mut files)?;
    files.sort();
    if files.is_empty() {
        return Err(Error::input(folder.display(), "no file", "CT images"));
    }
    let read: Vec<Result<Slice>> = files.par_iter().map(|path| Slice::look(path)).collect();
    // Report the first error in path order, regardless of thread timing.
    read.into_iter().collect()
}

fn collect(folder: &Path, depth: usize, to: &mut Vec<PathBuf>) -> Result<()> {
    let io = |e| Error::io(folder, e);
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let path = entry.map_err(io)?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with('.') || name.eq_ignore_ascii_case("DICOMDIR") {
            continue;
        }
        if !path.is_dir() {
            to.push(path);
        } else if depth < DEEPEST {
            collect(&path, depth + 1, to)?;
        } else {
            let found = format!("more than {DEEPEST} nested folders");
            return Err(Error::input(path.display(), found, "a study's folders"));
        }
        if to.len() > MOST_FILES {
            return Err(Error::input(
                folder.display(),
                format!("more than {MOST_FILES} files"),
                "the images of one patient",
            ));
        }
    }
    Ok(())
}
