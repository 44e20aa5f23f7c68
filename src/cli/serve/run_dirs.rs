//! Where the endpoints of devices are kept.

use super::Args;
use super::asked::Asked;
use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// A directory for each device: of its own under [`run_parent`], the one that was asked for, or for
/// several devices one each in it.
pub(super) fn run_dirs(args: &Args, devices: &[Asked]) -> Result<Vec<PathBuf>> {
    let names: Vec<&str> = devices.iter().map(|device| device.name.as_str()).collect();
    match &args.run_dir {
        // device.json is read from anywhere.
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

/// `$XDG_RUNTIME_DIR/phasma-NAME`, or `/tmp/phasma-UID-NAME`.
pub(in crate::cli) fn default_run_dir(name: &str) -> PathBuf {
    match runtime_dir() {
        Some(dir) => dir.join(format!("phasma-{name}")),
        None => {
            let user = rustix::process::geteuid().as_raw();
            std::env::temp_dir().join(format!("phasma-{user}-{name}"))
        }
    }
}

/// Where run directories are made.
pub(in crate::cli) fn run_parent() -> PathBuf {
    runtime_dir().unwrap_or_else(std::env::temp_dir)
}

fn runtime_dir() -> Option<PathBuf> {
    let dir = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    dir.filter(|dir| dir.is_absolute() && dir.is_dir())
}

/// The directory that holds those of several devices; it goes again, if it was made and is empty.
pub(super) struct Holder(Option<PathBuf>);

impl Holder {
    /// Makes the directory if it is to hold several and is not there.
    ///
    /// # Errors
    /// What the system refuses.
    pub(super) fn make(dirs: &[PathBuf], asked_for: bool) -> Result<Self> {
        let parent = match dirs {
            [first, _, ..] if asked_for => first.parent().filter(|parent| !parent.exists()),
            _ => None,
        };
        if let Some(parent) = parent {
            make_private(parent)?;
        }
        Ok(Self(parent.map(Path::to_owned)))
    }
}

fn make_private(path: &Path) -> Result<()> {
    use std::os::unix::fs::DirBuilderExt;
    let made = std::fs::DirBuilder::new().mode(0o700).create(path);
    made.map_err(|e| Error::io(path, e))
}

impl Drop for Holder {
    fn drop(&mut self) {
        if let Some(path) = &self.0 {
            // Whoever has put something there meanwhile keeps it.
            let _ = std::fs::remove_dir(path);
        }
    }
}
