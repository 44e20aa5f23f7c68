//! The folder that a calibration goes to, which holds all of it or nothing.

use super::{Args, CAPTURES, OPENCV, TRUTH};
use phasmid_calibrate::report;
use phasmid_core::error::{Error, Result};
use phasmid_host::MANIFEST_FILE;
use std::fs;
use std::path::{Path, PathBuf};

/// Folder in it of what a run has made that is not over. One that was cut short leaves it; the next
/// one throws it away.
const DRAFT: &str = "phasmid-unfinished";

/// A folder that a calibration is being made for. When it goes, so does what was not kept, and the
/// folders that were made for it if nothing is in them.
pub(super) struct Folder {
    out: PathBuf,
    draft: PathBuf,
    /// Folders that were not there before, the innermost first.
    made: Vec<PathBuf>,
}

impl Folder {
    /// Makes the folder, and refuses one with files under the names of ours unless they may go.
    ///
    /// # Errors
    /// See [`report::prepare`]; captures of an earlier calibration.
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
        // So that no pose of an earlier calibration stands beside those of this one.
        if had_captures && (args.keep_captures || earlier) {
            forget(&captures, args.keep_captures)?;
        }
        if folder.draft.exists() {
            fs::remove_dir_all(&folder.draft).map_err(|e| Error::io(&folder.draft, e))?;
        }
        create_private(&folder.draft).map_err(|e| Error::io(&folder.draft, e))?;
        Ok(folder)
    }

    /// Where pictures and captures go at first.
    pub(super) fn draft(&self) -> &Path {
        &self.draft
    }

    /// Moves the captures to where they stay.
    ///
    /// # Errors
    /// What the system refuses.
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

    /// Moves pictures to where they stay.
    ///
    /// # Errors
    /// What the system refuses.
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
        // Nothing more can be done here, and a folder that is not empty stays.
        if fs::remove_dir_all(&self.draft).is_ok() || !self.draft.exists() {
            self.made.iter().all(|made| fs::remove_dir(made).is_ok());
        }
    }
}

/// Makes a folder that is new and for its owner alone.
fn create_private(path: &Path) -> std::io::Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::DirBuilderExt as _;
        fs::DirBuilder::new().mode(0o700).create(path)
    }
    #[cfg(not(unix))]
    fs::create_dir(path)
}

/// Whether a folder is one that poses are read from.
fn is_read(args: &Args, folder: &Path) -> bool {
    let Some(read) = &args.captures else {
        return false;
    };
    match (read.canonicalize(), folder.canonicalize()) {
        (Ok(read), Ok(folder)) => read.starts_with(&folder) || folder.starts_with(&read),
        // Better one folder too many than one too few.
        _ => true,
    }
}

/// Removes an earlier calibration's captures. Where new ones are to come, nothing may stand in their
/// way.
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
            let found = "no capture, but its name is one's";
            return Err(Error::input(path.display(), found, "another --out"));
        }
    }
    // Other things may be in it.
    let _ = fs::remove_dir(captures);
    Ok(())
}
