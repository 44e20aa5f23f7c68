//! The output folder of a calibration, which receives all results or none.

use super::{Args, CAPTURES, OPENCV, TRUTH};
use phasmid_calibrate::report;
use phasmid_core::error::{Error, Result};
use phasmid_host::MANIFEST_FILE;
use std::fs;
use std::path::{Path, PathBuf};

/// Subfolder for the output of a run in progress. An interrupted run leaves it behind; the next run
/// deletes it.
const DRAFT: &str = "phasmid-unfinished";

/// The output folder of a calibration in progress. Dropping it deletes output that was not kept, and
/// the folders that were created for it if they are empty.
pub(super) struct Folder {
    out: PathBuf,
    draft: PathBuf,
    /// Folders that did not exist before, innermost first.
    made: Vec<PathBuf>,
}

impl Folder {
    /// Creates the folder. Without `--force`, rejects existing files that have names of results.
    ///
    /// # Errors
    /// Returns an error as [`report::prepare`] does, or if captures of an earlier calibration exist
    /// and new ones are to be kept without `--force`.
    pub(super) fn prepare(args: &Args) -> Result<Self> {
        let out = args.out.clone();
        let is_new = |path: &&Path| !path.as_os_str().is_empty() && !path.exists();
        let folder = Self {
            draft: out.join(DRAFT),
            made: out
                .ancestors()
                .take_while(is_new)
                .map(Path::to_owned)
                .collect(),
            out,
        };
        let captures = folder.out.join(CAPTURES);
        let had_captures = captures.symlink_metadata().is_ok();
        if args.keep_captures && had_captures && !args.force {
            return Err(Error::input(
                format!("--out {}", args.out.display()),
                format!("{CAPTURES}, of an earlier calibration"),
                "another folder, or --force to overwrite",
            ));
        }
        let earlier = report::is_calibration(&folder.out) && !is_read(args, &captures);
        let [yaml, xml] = OPENCV;
        report::prepare(&folder.out, &[TRUTH, yaml, xml], args.force)?;
        // Otherwise, poses of an earlier calibration would remain among the new ones.
        if had_captures && (args.keep_captures || earlier) {
            forget(&captures, args.keep_captures)?;
        }
        if folder.draft.exists() {
            fs::remove_dir_all(&folder.draft).map_err(|e| Error::io(&folder.draft, e))?;
        }
        create_private(&folder.draft).map_err(|e| Error::io(&folder.draft, e))?;
        Ok(folder)
    }

    /// Returns the folder for images and captures of the run in progress.
    pub(super) fn draft(&self) -> &Path {
        &self.draft
    }

    /// Moves the captures to the output folder.
    ///
    /// # Errors
    /// Returns an error if a file or folder cannot be moved.
    pub(super) fn keep_captures(&self) -> Result<()> {
        let (from, to) = (self.draft.join(CAPTURES), self.out.join(CAPTURES));
        if !from.exists() {
            return Ok(());
        }
        fs::create_dir_all(&to).map_err(|e| Error::io(&to, e))?;
        for entry in fs::read_dir(&from).map_err(|e| Error::io(&from, e))? {
            let entry = entry.map_err(|e| Error::io(&from, e))?;
            let target = to.join(entry.file_name());
            fs::rename(entry.path(), &target).map_err(|e| Error::io(&target, e))?;
        }
        Ok(())
    }

    /// Moves images to the output folder.
    ///
    /// # Errors
    /// Returns an error if a file cannot be moved.
    pub(super) fn keep<'a>(&self, names: impl Iterator<Item = &'a str>) -> Result<()> {
        for name in names {
            let target = self.out.join(name);
            fs::rename(self.draft.join(name), &target).map_err(|e| Error::io(&target, e))?;
        }
        Ok(())
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // Errors are ignored; folders that are not empty remain.
        if fs::remove_dir_all(&self.draft).is_ok() || !self.draft.exists() {
            self.made.iter().all(|made| fs::remove_dir(made).is_ok());
        }
    }
}

/// Creates a folder that only its owner can access. Fails if it exists.
fn create_private(path: &Path) -> std::io::Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::DirBuilderExt as _;
        fs::DirBuilder::new().mode(0o700).create(path)
    }
    #[cfg(not(unix))]
    fs::create_dir(path)
}

/// Whether poses are read from this folder, from a subfolder, or from a parent folder.
fn is_read(args: &Args, folder: &Path) -> bool {
    let Some(read) = &args.captures else {
        return false;
    };
    match (read.canonicalize(), folder.canonicalize()) {
        (Ok(read), Ok(folder)) => read.starts_with(&folder) || folder.starts_with(&read),
        // If in doubt, treat the folder as an input, which is not deleted.
        _ => true,
    }
}

/// Removes the captures of an earlier calibration. With `more_to_come`, a folder that is not a capture
/// but would be in the way of one is an error.
fn forget(captures: &Path, more_to_come: bool) -> Result<()> {
    for entry in fs::read_dir(captures).map_err(|e| Error::io(captures, e))? {
        let path = entry.map_err(|e| Error::io(captures, e))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if !name.starts_with("pose_") {
            continue;
        }
        if path.join(MANIFEST_FILE).exists() {
            fs::remove_dir_all(&path).map_err(|e| Error::io(&path, e))?;
        } else if more_to_come {
            let found = "not a capture, but named like one";
            return Err(Error::input(path.display(), found, "another --out"));
        }
    }
    // Fails if other files remain in it, which is fine.
    let _ = fs::remove_dir(captures);
    Ok(())
}
