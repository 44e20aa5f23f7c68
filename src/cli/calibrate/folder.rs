//! The output folder of a calibration, which receives all results or none.

use super::{Args, CAPTURES, OPENCV, TRUTH};
use phasmid_calibrate::report;
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file::{self, is_unfinished, scratch_in};
use phasmid_host::MANIFEST_FILE;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The output folder of a calibration in progress. Dropping it deletes output that was not kept, and
/// the folders that were created for it if they are empty.
pub(super) struct Folder {
    out: PathBuf,
    force: bool,
    /// Subfolder for the output of the run in progress. A killed run leaves it behind; the next run
    /// deletes it.
    draft: TempDir,
    /// Lock on the draft folder, which marks it as in use.
    _lock: Option<File>,
    /// Dropped after the draft, so that the folders are empty.
    _made: Made,
}

/// Folders that did not exist before, innermost first. Dropping it removes the empty ones.
struct Made(Vec<PathBuf>);

impl Folder {
    /// Creates the folder. Without `--force`, rejects existing files that have names of results.
    ///
    /// # Errors
    /// Returns an error as [`report::prepare`] does, or if captures of an earlier calibration exist
    /// and new ones are to be kept without `--force`.
    pub(super) fn prepare(args: &Args) -> Result<Self> {
        let out = args.out.clone();
        let is_new = |path: &&Path| !path.as_os_str().is_empty() && !path.exists();
        let new = out.ancestors().take_while(is_new).map(Path::to_owned);
        let made = Made(new.collect());
        let captures = out.join(CAPTURES);
        let had_captures = captures.symlink_metadata().is_ok();
        if args.keep_captures && had_captures && !args.force {
            return Err(Error::input(
                format!("--out {}", args.out.display()),
                format!("{CAPTURES}, of an earlier calibration"),
                "another folder, or --force to overwrite",
            ));
        }
        let earlier = report::is_calibration(&out) && !is_read(args, &captures);
        // Otherwise, poses of an earlier calibration would remain among the new ones.
        let old = match had_captures && (args.keep_captures || earlier) {
            true => old_poses(&captures, args.keep_captures)?,
            false => Vec::new(),
        };
        let [yaml, xml] = OPENCV;
        report::prepare(&out, &[TRUTH, yaml, xml], args.force)?;
        for path in &old {
            fs::remove_dir_all(path).map_err(|e| Error::io(path, e))?;
        }
        if !old.is_empty() {
            // Fails if other files remain in it, which is fine.
            let _ = fs::remove_dir(&captures);
        }
        remove_drafts(&out)?;
        let draft = scratch_in(&out)?;
        Ok(Self {
            out,
            force: args.force,
            _lock: locked(draft.path()),
            draft,
            _made: made,
        })
    }

    /// Returns the folder for images and captures of the run in progress.
    pub(super) fn draft(&self) -> &Path {
        self.draft.path()
    }

    /// Moves the captures to the output folder.
    ///
    /// # Errors
    /// Returns an error if a file or folder cannot be moved.
    pub(super) fn keep_captures(&self) -> Result<()> {
        let (from, to) = (self.draft().join(CAPTURES), self.out.join(CAPTURES));
        if !from.exists() {
            return Ok(());
        }
        match fs::create_dir(&to) {
            // Not a link to a folder.
            Err(_) if to.symlink_metadata().is_ok_and(|about| about.is_dir()) => {}
            made => made.map_err(|e| Error::io(&to, e))?,
        }
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
            new_file::rename(&self.draft().join(name), &self.out.join(name), self.force)?;
        }
        Ok(())
    }
}

impl Drop for Made {
    fn drop(&mut self) {
        // Errors are ignored; folders that are not empty remain.
        self.0.iter().all(|made| fs::remove_dir(made).is_ok());
    }
}

/// Locks a folder until the returned file is dropped or the process ends, if it is not locked yet
/// and the system can lock folders.
fn locked(folder: &Path) -> Option<File> {
    let file = File::open(folder).ok()?;
    file.try_lock().is_ok().then_some(file)
}

/// Deletes drafts of killed runs. Those of other runs in progress are locked.
fn remove_drafts(out: &Path) -> Result<()> {
    for entry in fs::read_dir(out).map_err(|e| Error::io(out, e))? {
        let entry = entry.map_err(|e| Error::io(out, e))?;
        // The type of a link is not that of its target.
        let is_dir = entry.file_type().is_ok_and(|kind| kind.is_dir());
        if is_dir && is_unfinished(&entry.file_name()) && locked(&entry.path()).is_some() {
            let path = entry.path();
            fs::remove_dir_all(&path).map_err(|e| Error::io(&path, e))?;
        }
    }
    Ok(())
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

/// Lists the poses captured by an earlier calibration. With `more_to_come`, anything else that would be
/// in the way of new ones is an error. Links are not followed: no calibration makes them.
fn old_poses(captures: &Path, more_to_come: bool) -> Result<Vec<PathBuf>> {
    let is_dir = |path: &Path| path.symlink_metadata().is_ok_and(|about| about.is_dir());
    let in_the_way = |path: &Path, found: &str| match more_to_come {
        true => Err(Error::input(path.display(), found, "another --out")),
        false => Ok(()),
    };
    let mut poses = Vec::new();
    if !is_dir(captures) {
        in_the_way(captures, "not a folder, but named like one of captures")?;
        return Ok(poses);
    }
    for entry in fs::read_dir(captures).map_err(|e| Error::io(captures, e))? {
        let path = entry.map_err(|e| Error::io(captures, e))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if !name.starts_with("pose_") {
            continue;
        }
        if is_dir(&path) && path.join(MANIFEST_FILE).exists() {
            poses.push(path);
        } else {
            in_the_way(&path, "not a capture, but named like one")?;
        }
    }
    Ok(poses)
}
