//! Directories for the endpoints of the devices.

use super::args::Args;
use super::asked::Asked;
use phasmid_core::error::{Error, Result};
use std::path::{Path, PathBuf};

/// Returns a directory for each device: the default directory under [`run_parent`], the requested
/// directory, or, with several devices, a folder in the requested directory.
pub(super) fn run_dirs(args: &Args, devices: &[Asked]) -> Result<Vec<PathBuf>> {
    let names: Vec<&str> = devices.iter().map(|device| device.name.as_str()).collect();
    match &args.run_dir {
        // Make the path absolute, because device.json, which contains it, is read by programs with
        // other working directories.
        Some(dir) => {
            let dir = std::path::absolute(dir).map_err(|e| Error::io(dir, e))?;
            Ok(match names.as_slice() {
                [_] => vec![dir],
                names => names.iter().map(|name| dir.join(name)).collect(),
            })
        }
        None => Ok(names.iter().map(|name| default_run_dir(name)).collect()),
    }
}

/// Checks the path of `--run-dir`, before any work is done for it.
///
/// # Errors
/// Returns an error if the path or one of its parents is not a directory.
pub(crate) fn check_run_dir(path: Option<&Path>) -> Result<()> {
    let existing = path.and_then(|path| path.ancestors().find(|p| p.symlink_metadata().is_ok()));
    match (path, existing.filter(|existing| !existing.is_dir())) {
        (Some(path), Some(file)) => Err(Error::input(
            format!("--run-dir {}", path.display()),
            match file == path {
                true => "a file".to_owned(),
                false => format!("{}, a file", file.display()),
            },
            "a new or empty directory that you own, or one that a device left behind",
        )),
        _ => Ok(()),
    }
}

/// `$XDG_RUNTIME_DIR/phasmid-NAME`, or `/tmp/phasmid-UID-NAME`.
pub(crate) fn default_run_dir(name: &str) -> PathBuf {
    match runtime_dir() {
        Some(dir) => dir.join(format!("phasmid-{name}")),
        None => {
            let user = rustix::process::geteuid().as_raw();
            std::env::temp_dir().join(format!("phasmid-{user}-{name}"))
        }
    }
}

/// Returns the folder in which run directories are created.
pub(crate) fn run_parent() -> PathBuf {
    runtime_dir().unwrap_or_else(std::env::temp_dir)
}

fn runtime_dir() -> Option<PathBuf> {
    let dir = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    dir.filter(|dir| dir.is_absolute() && dir.is_dir())
}

/// Marks a parent directory that was created for the run directories of several devices. A later
/// run recognises the directory by this mark, even if the process that created it was killed.
const MARK: &str = ".phasmid-made-this";

/// Parent directory of the run directories of several devices. Dropping this value removes the
/// directory if it was created for this purpose and is empty.
pub(super) struct Holder(Option<PathBuf>);

impl Holder {
    /// Creates the directory if it is needed for several devices and does not exist.
    ///
    /// # Errors
    /// Returns an error if the directory or the mark in it cannot be created.
    pub(super) fn make(dirs: &[PathBuf], asked_for: bool) -> Result<Self> {
        let parent = match dirs {
            [first, _, ..] if asked_for => first.parent(),
            _ => None,
        };
        let Some(parent) = parent else {
            return Ok(Self(None));
        };
        let mark = parent.join(MARK);
        if !parent.exists() {
            make_private(parent)?;
            let holder = Self(Some(parent.to_owned()));
            std::fs::write(&mark, "").map_err(|e| Error::io(mark, e))?;
            return Ok(holder);
        }
        let left = std::fs::symlink_metadata(mark).is_ok_and(|mark| mark.is_file());
        Ok(Self(left.then(|| parent.to_owned())))
    }
}

fn make_private(path: &Path) -> Result<()> {
    use std::os::unix::fs::DirBuilderExt;
    let made = std::fs::DirBuilder::new().mode(0o700).create(path);
    made.map_err(|e| Error::io(path, e))
}

impl Drop for Holder {
    fn drop(&mut self) {
        let Some(path) = &self.0 else {
            return;
        };
        // Keep the directory if it contains anything except the mark, such as the devices of
        // another station.
        let others = std::fs::read_dir(path).map_or(true, |mut entries| {
            entries.any(|entry| entry.map_or(true, |entry| entry.file_name() != MARK))
        });
        if !others {
            let _ = std::fs::remove_file(path.join(MARK));
            let _ = std::fs::remove_dir(path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn removes_only_directories_that_it_made_also_after_a_kill() {
        let base = tempfile::tempdir().unwrap();
        let run = base.path().join("run");
        let dirs = ["left", "right"].map(|name| run.join(name));
        let holder = Holder::make(&dirs, true).unwrap();
        std::fs::create_dir(&dirs[0]).unwrap();
        drop(holder);
        assert!(run.exists(), "somebody's");
        // Leave the parent and its mark in place, as after a kill. Another holder then removes the
        // parent once it is empty.
        let holder = Holder::make(&dirs, true).unwrap();
        std::fs::remove_dir(&dirs[0]).unwrap();
        drop(holder);
        assert!(!run.exists());
        std::fs::create_dir(&run).unwrap();
        drop(Holder::make(&dirs, true).unwrap());
        assert!(run.exists(), "the folder existed before");
        drop(Holder::make(&dirs[..1], true).unwrap());
        drop(Holder::make(&dirs, false).unwrap());
        assert_eq!(std::fs::read_dir(&run).unwrap().count(), 0);
    }
}
