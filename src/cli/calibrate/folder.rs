//! The output folder of a calibration, which receives all results or none.

use super::{Args, CAPTURES, OPENCV, TRUTH};
use phasmid_calibrate::report;
use phasmid_core::error::{Error, Result};
use phasmid_core::output_folder::OutputFolder;
use phasmid_host::MANIFEST_FILE;
use std::fs;
use std::path::{Path, PathBuf};

/// The output folder of a calibration in progress.
pub(super) struct Folder {
    folder: OutputFolder,
    captures: PathBuf,
    /// Names of files of an earlier calibration.
    earlier: Vec<PathBuf>,
    /// Poses captured by an earlier calibration, which would remain among the new ones.
    old: Vec<PathBuf>,
}

impl Folder {
    /// Creates the folder. Without `--force`, rejects existing files that have names of results.
    ///
    /// # Errors
    /// Returns an error as [`report::check_folder`] does, or if captures of an earlier calibration
    /// exist and new ones are to be kept without `--force`.
    pub(super) fn prepare(args: &Args) -> Result<Self> {
        let captures = args.out.join(CAPTURES);
        let had_captures = captures.symlink_metadata().is_ok();
        if args.keep_captures && had_captures && !args.force {
            return Err(Error::input(
                format!("--out {}", args.out.display()),
                format!("{CAPTURES}, of an earlier calibration"),
                "another folder, or --force to overwrite",
            ));
        }
        let earlier = report::is_calibration(&args.out) && !is_read(args, &captures);
        let old = match had_captures && (args.keep_captures || earlier) {
            true => old_poses(&captures, args.keep_captures)?,
            false => Vec::new(),
        };
        let [yaml, xml] = OPENCV;
        Ok(Self {
            earlier: report::check_folder(&args.out, &[TRUTH, yaml, xml], args.force)?,
            folder: OutputFolder::create(&args.out, args.force)?,
            captures,
            old,
        })
    }

    /// Returns the folder for the output of the run in progress.
    pub(super) fn draft(&self) -> &Path {
        self.folder.draft()
    }

    /// Moves the captures to the output folder, where they outlast a failure to calibrate.
    ///
    /// # Errors
    /// Returns an error if a file or folder cannot be moved.
    pub(super) fn keep_captures(&mut self) -> Result<()> {
        if self.draft().join(CAPTURES).exists() {
            self.remove_old_poses()?;
        }
        self.folder.keep(CAPTURES)
    }

    /// Moves all other files to the output folder.
    ///
    /// # Errors
    /// Returns an error if a file cannot be moved.
    pub(super) fn finish(mut self) -> Result<()> {
        self.remove_old_poses()?;
        self.folder.finish(self.earlier, Some(report::MARKER))
    }

    fn remove_old_poses(&mut self) -> Result<()> {
        if self.old.is_empty() {
            return Ok(());
        }
        for path in self.old.drain(..) {
            fs::remove_dir_all(&path).map_err(|e| Error::io(&path, e))?;
        }
        // Fails if other files remain in it, which is fine.
        let _ = fs::remove_dir(&self.captures);
        Ok(())
    }
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
