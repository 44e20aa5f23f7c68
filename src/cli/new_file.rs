//! A file of a result, where none may be yet.

use crate::error::{Error, Result};
use std::fs::File;
use std::io::ErrorKind;
use std::path::Path;

/// Refuses a file that is there, before anything is done for it.
///
/// # Errors
/// Such a file, and a folder that is not there.
pub(super) fn check(path: &Path) -> Result<()> {
    if path.exists() {
        return Err(there(path));
    }
    match path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
    {
        Some(folder) if !folder.is_dir() => Err(Error::input(
            format!("--out {}", path.display()),
            format!("no folder {}", folder.display()),
            "a new file in a folder that is there",
        )),
        _ => Ok(()),
    }
}

/// Makes the file.
///
/// # Errors
/// One that has come meanwhile, and what the system refuses.
pub(super) fn create(path: &Path) -> Result<File> {
    File::create_new(path).map_err(|e| match e.kind() {
        ErrorKind::AlreadyExists => there(path),
        _ => Error::io(path, e),
    })
}

fn there(path: &Path) -> Error {
    Error::input(
        format!("--out {}", path.display()),
        "a file that is there already",
        "a new file",
    )
}
