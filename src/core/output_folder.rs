//! Output folders that receive all files of a result or none.

use crate::error::{Error, Result};
use crate::new_file::{self, check_folder, is_unfinished, scratch_in};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// An output folder being filled. Files are written to [`Self::draft`], a private folder in it, and
/// moved when all are complete. Until then, files of an earlier result stay unchanged. Dropping the value
/// deletes what was not moved, and the folders created for it if they are empty.
pub struct OutputFolder {
    out: PathBuf,
    force: bool,
    /// A killed program leaves it behind; the next [`Self::create`] deletes it.
    draft: TempDir,
    /// Lock on the draft, which marks it as in use.
    _lock: Option<File>,
    /// Dropped after the draft, so that the folders are empty.
    _made: Made,
}

/// Folders that did not exist before, innermost first. Dropping it removes the empty ones.
struct Made(Vec<PathBuf>);

impl OutputFolder {
    /// Creates the folder if it does not exist, and a draft in it. Existing files are replaced only
    /// with `force`; check their names with [`check_folder`] before any work is done for new ones.
    ///
    /// # Errors
    /// Returns an error if the path or one of its parents is not a folder, or the system's error.
    pub fn create(out: &Path, force: bool) -> Result<Self> {
        check_folder(out, [""; 0], force)?;
        let is_new = |path: &&Path| !path.as_os_str().is_empty() && !path.exists();
        let new = out.ancestors().take_while(is_new).map(Path::to_owned);
        let made = Made(new.collect());
        fs::create_dir_all(out).map_err(|e| Error::io(out, e))?;
        remove_drafts(out);
        let draft = scratch_in(out)?;
        Ok(Self {
            out: out.to_owned(),
            force,
            _lock: locked(draft.path()),
            draft,
            _made: made,
        })
    }

    /// Returns the folder to write files and subfolders to.
    pub fn draft(&self) -> &Path {
        self.draft.path()
    }

    /// Moves the files of one subfolder of the draft now, so that they outlast a later failure.
    ///
    /// # Errors
    /// Returns the errors of [`Self::finish`].
    pub fn keep(&self, subfolder: &str) -> Result<()> {
        self.put(&self.files_below(Path::new(subfolder))?)
    }

    /// Moves all files of the draft. `earlier` are the names of files that an earlier result may have
    /// left; with `force`, they are deleted unless they are replaced. `marker`, whose presence shows that
    /// the result is complete, is removed first and moved last.
    ///
    /// # Errors
    /// Returns an error if a file exists and `force` is not set, or the system's error. In the first
    /// case no file has been moved.
    pub fn finish(
        self,
        earlier: impl IntoIterator<Item = impl AsRef<Path>>,
        marker: Option<&str>,
    ) -> Result<()> {
        let mut files = self.files_below(Path::new(""))?;
        files.sort_by_key(|file| marker.is_some_and(|marker| file.as_os_str() == marker));
        if self.force {
            let stale = earlier.into_iter().map(|name| name.as_ref().to_owned());
            let mut stale: Vec<PathBuf> = stale.filter(|name| !files.contains(name)).collect();
            check_folder(&self.out, files.iter().chain(&stale), true)?;
            stale.extend(marker.map(PathBuf::from));
            for path in stale.iter().map(|name| self.out.join(name)) {
                match fs::remove_file(&path) {
                    Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                        return Err(Error::io(path, e));
                    }
                    _ => {}
                }
            }
        }
        self.put(&files)
    }

    /// Moves files, which are relative to the draft.
    fn put(&self, files: &[PathBuf]) -> Result<()> {
        check_folder(&self.out, files, self.force)?;
        for (moved, file) in files.iter().enumerate() {
            let (from, to) = (self.draft().join(file), self.out.join(file));
            self.create_parents(file)?;
            if let Err(why) = new_file::rename(&from, &to, self.force) {
                if !self.force {
                    // Nothing existed under these names.
                    for file in &files[..moved] {
                        let _ = fs::remove_file(self.out.join(file));
                    }
                }
                return Err(why);
            }
        }
        Ok(())
    }

    /// Creates the subfolders of the output folder for a file. Does not follow links.
    fn create_parents(&self, file: &Path) -> Result<()> {
        let parents = file.ancestors().skip(1);
        let mut parents: Vec<&Path> = parents.filter(|p| !p.as_os_str().is_empty()).collect();
        parents.reverse();
        for parent in parents {
            let path = self.out.join(parent);
            match fs::create_dir(&path) {
                Err(_) if path.symlink_metadata().is_ok_and(|about| about.is_dir()) => {}
                made => made.map_err(|e| Error::io(&path, e))?,
            }
        }
        Ok(())
    }

    /// Returns the files in a subfolder of the draft, relative to the draft and sorted.
    fn files_below(&self, subfolder: &Path) -> Result<Vec<PathBuf>> {
        let mut files = Vec::new();
        let mut folders = vec![subfolder.to_owned()];
        while let Some(folder) = folders.pop() {
            let path = self.draft().join(&folder);
            if !path.exists() {
                continue;
            }
            for entry in fs::read_dir(&path).map_err(|e| Error::io(&path, e))? {
                let entry = entry.map_err(|e| Error::io(&path, e))?;
                let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
                let list = if is_folder { &mut folders } else { &mut files };
                list.push(folder.join(entry.file_name()));
            }
        }
        files.sort_unstable();
        Ok(files)
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

/// Deletes drafts of killed programs, as far as possible. Those of other runs in progress are locked.
fn remove_drafts(out: &Path) {
    for entry in fs::read_dir(out).into_iter().flatten().flatten() {
        // The type of a link is not that of its target.
        let is_dir = entry.file_type().is_ok_and(|kind| kind.is_dir());
        if is_dir && is_unfinished(&entry.file_name()) && locked(&entry.path()).is_some() {
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(path: PathBuf) -> String {
        fs::read_to_string(path).unwrap_or_default()
    }

    /// Number of entries of a folder, hidden ones included.
    fn count(folder: &Path) -> usize {
        fs::read_dir(folder).unwrap().count()
    }

    #[test]
    fn earlier_results_stay_until_all_files_are_complete() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        for name in ["a", "stale", "marker", "mine"] {
            fs::write(out.join(name), "old").unwrap();
        }
        let folder = OutputFolder::create(out, true).unwrap();
        fs::write(folder.draft().join("a"), "new").unwrap();
        assert_eq!(text(out.join("a")), "old");
        drop(folder);
        assert_eq!((text(out.join("a")), count(out)), ("old".to_owned(), 4));

        let folder = OutputFolder::create(out, true).unwrap();
        for name in ["a", "marker"] {
            fs::write(folder.draft().join(name), "new").unwrap();
        }
        fs::create_dir(folder.draft().join("sub")).unwrap();
        fs::write(folder.draft().join("sub/b"), "new").unwrap();
        folder
            .finish(["a", "stale", "marker"], Some("marker"))
            .unwrap();
        for name in ["a", "marker", "sub/b"] {
            assert_eq!(text(out.join(name)), "new", "{name}");
        }
        assert_eq!(text(out.join("mine")), "old");
        assert_eq!(count(out), 4);
    }

    #[test]
    fn without_force_a_file_created_meanwhile_is_kept_and_nothing_moved() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("x/y");
        let folder = OutputFolder::create(&out, false).unwrap();
        for name in ["a", "b"] {
            fs::write(folder.draft().join(name), "new").unwrap();
        }
        fs::write(out.join("b"), "theirs").unwrap();
        let refused = folder.finish(["a", "b"], Some("b")).unwrap_err();
        assert_eq!(refused.exit_code(), 2);
        assert_eq!((text(out.join("b")), count(&out)), ("theirs".to_owned(), 1));
    }

    #[test]
    fn kept_subfolders_outlast_a_failure() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("x");
        drop(OutputFolder::create(&out.join("y"), false).unwrap());
        assert!(!out.exists());
        let folder = OutputFolder::create(&out, false).unwrap();
        fs::create_dir_all(folder.draft().join("captures/pose")).unwrap();
        fs::write(folder.draft().join("captures/pose/a"), "new").unwrap();
        fs::write(folder.draft().join("b"), "new").unwrap();
        folder.keep("captures").unwrap();
        folder.keep("nothing").unwrap();
        drop(folder);
        assert_eq!(text(out.join("captures/pose/a")), "new");
        assert_eq!(count(&out), 1);
    }

    #[test]
    fn drafts_of_killed_programs_are_deleted_but_not_those_in_use() {
        let dir = tempfile::tempdir().unwrap();
        let left = dir.path().join(".phasmid-abc.partial");
        fs::create_dir(&left).unwrap();
        fs::write(left.join("a"), "half").unwrap();
        let one = OutputFolder::create(dir.path(), false).unwrap();
        assert!(!left.exists());
        let other = OutputFolder::create(dir.path(), false).unwrap();
        assert!(one.draft().exists() && other.draft().exists());
    }

    #[cfg(unix)]
    #[test]
    fn follows_no_link_to_a_folder() {
        let (dir, theirs) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        std::os::unix::fs::symlink(theirs.path(), dir.path().join("sub")).unwrap();
        let folder = OutputFolder::create(dir.path(), true).unwrap();
        fs::create_dir(folder.draft().join("sub")).unwrap();
        fs::write(folder.draft().join("sub/a"), "new").unwrap();
        assert!(folder.finish([""; 0], None).is_err());
        assert_eq!(count(theirs.path()), 0);
    }
}
