//! Output folders that receive all files of a result or none.

use crate::error::{Error, Result};
use crate::new_file::{self, check_folder, is_unfinished, scratch_in};
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Subfolder of the draft that holds the replaced files while new files are moved.
const REPLACED: &str = ".replaced";
/// Maximum number of attempts to create a draft that no other program deletes.
const TRIES: usize = 20;
/// Maximum time to wait for another program that moves its files to the same folder.
const PATIENCE: Duration = Duration::from_secs(2);

/// An output folder being filled. Files are written to [`Self::draft`], a private folder in it, and
/// moved when all are complete. Until then, files of an earlier result stay unchanged. Dropping the
/// value deletes the files that were not moved, and the folders that were created for them if they are
/// empty.
pub struct OutputFolder {
    out: PathBuf,
    force: bool,
    /// Files that must not be replaced, with their links resolved.
    inputs: Vec<PathBuf>,
    /// Draft of the files. A killed program leaves it behind; the next [`Self::create`] deletes it.
    draft: TempDir,
    /// Lock on the draft. It shows other programs that the draft is in use.
    _lock: Option<File>,
    /// This field is dropped after `draft`, so that the created folders are empty.
    _made: Made,
}

/// Folders that were created, innermost first. Dropping this value removes the empty ones among
/// them.
struct Made(Vec<PathBuf>);

impl OutputFolder {
    /// Creates the folder if it does not exist, and a draft in it. Existing files are replaced only
    /// with `force`; check their names with [`check_folder`] before any work is done for new ones.
    ///
    /// # Errors
    /// Returns an error if the path or one of its parents is not a folder, or the system's error.
    pub fn create(out: &Path, force: bool) -> Result<Self> {
        check_folder(out, [""; 0], force)?;
        let made = Made::create(out)?;
        remove_drafts(out);
        let (draft, lock) = draft_in(out)?;
        Ok(Self {
            out: out.to_owned(),
            force,
            inputs: Vec::new(),
            draft,
            _lock: lock,
            _made: made,
        })
    }

    /// Adds files from which the result is computed. They are never replaced, even with `force`.
    #[must_use]
    pub fn sparing(mut self, inputs: impl IntoIterator<Item = impl AsRef<Path>>) -> Self {
        let inputs = inputs.into_iter();
        let resolved = inputs.filter_map(|input| input.as_ref().canonicalize().ok());
        self.inputs.extend(resolved);
        self
    }

    /// Returns the folder to write files and subfolders to.
    pub fn draft(&self) -> &Path {
        self.draft.path()
    }

    /// Moves the files of one subfolder of the draft now, so that they remain if a later step
    /// fails.
    ///
    /// # Errors
    /// Returns the errors of [`Self::finish`].
    pub fn keep(&self, subfolder: &str) -> Result<()> {
        self.put(&self.files_below(Path::new(subfolder))?, &[])
    }

    /// Moves all files of the draft. `earlier` are the names of files that an earlier result may have
    /// left; with `force`, they are deleted unless they are replaced. `marker`, whose presence shows that
    /// the result is complete, is removed first and moved last.
    ///
    /// # Errors
    /// Returns an error if a file exists and `force` is not set, if an input would be replaced, or the
    /// system's error. Then the folder is as it was before.
    pub fn finish(
        self,
        earlier: impl IntoIterator<Item = impl AsRef<Path>>,
        marker: Option<&str>,
    ) -> Result<()> {
        let mut files = self.files_below(Path::new(""))?;
        files.sort_by_key(|file| marker.is_some_and(|marker| file.as_os_str() == marker));
        let mut gone = Vec::new();
        if self.force {
            gone.extend(marker.map(PathBuf::from));
            gone.extend(earlier.into_iter().map(|name| name.as_ref().to_owned()));
        }
        self.put(&files, &gone)
    }

    /// Moves `files`, given by paths relative to the draft, to the output folder, and removes the
    /// files `gone` from it, if they exist.
    fn put(&self, files: &[PathBuf], gone: &[PathBuf]) -> Result<()> {
        check_folder(&self.out, files.iter().chain(gone), self.force)?;
        if !self.inputs.is_empty() {
            for file in files.iter().chain(gone) {
                let target = self.out.join(file);
                if target
                    .canonicalize()
                    .is_ok_and(|it| self.inputs.contains(&it))
                {
                    return Err(Error::input(
                        target.display(),
                        "a file that is an input of this result",
                        "another folder for the output",
                    ));
                }
            }
        }
        let _alone = self.lock_out();
        let mut moves = Vec::new();
        let moved = self.put_all(files, gone, &mut moves);
        if moved.is_err() {
            // Undo the moves. Ignore errors of undoing; the error that stopped the moves is
            // returned.
            for (from, to) in moves.iter().rev() {
                let _ = fs::rename(to, from);
            }
        }
        moved
    }

    fn put_all(
        &self,
        files: &[PathBuf],
        gone: &[PathBuf],
        moves: &mut Vec<(PathBuf, PathBuf)>,
    ) -> Result<()> {
        let replaced = self.draft().join(REPLACED);
        if self.force {
            for file in gone.iter().chain(files) {
                let (from, to) = (self.out.join(file), replaced.join(file));
                if from.symlink_metadata().is_err() {
                    continue;
                }
                let parent = to.parent().unwrap_or(&replaced);
                fs::create_dir_all(parent).map_err(|e| Error::io(parent, e))?;
                fs::rename(&from, &to).map_err(|e| Error::io(&from, e))?;
                moves.push((from, to));
            }
        }
        for file in files {
            let (from, to) = (self.draft().join(file), self.out.join(file));
            self.create_parents(file)?;
            new_file::rename(&from, &to, false)?;
            moves.push((from, to));
        }
        Ok(())
    }

    /// Locks the output folder against other programs that move files to it. Waits at most
    /// [`PATIENCE`] for the lock, because another program may hold it for another purpose.
    fn lock_out(&self) -> Option<File> {
        let folder = File::open(&self.out).ok()?;
        let end = Instant::now() + PATIENCE;
        while folder.try_lock().is_err() {
            if Instant::now() >= end {
                return None;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        Some(folder)
    }

    /// Creates the subfolders of the output folder that `file` needs. Does not follow symbolic
    /// links.
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
                let name = folder.join(entry.file_name());
                if is_folder && name.as_os_str() != REPLACED {
                    folders.push(name);
                } else if !is_folder {
                    files.push(name);
                }
            }
        }
        files.sort_unstable();
        Ok(files)
    }
}

impl Made {
    /// Creates a folder and its parents.
    fn create(out: &Path) -> Result<Self> {
        let mut made = Self(Vec::new());
        let mut parents: Vec<&Path> = out.ancestors().collect();
        parents.reverse();
        for path in parents {
            if path.as_os_str().is_empty() || path.is_dir() {
                continue;
            }
            match fs::create_dir(path) {
                Ok(()) => made.0.insert(0, path.to_owned()),
                // Another program has just created the folder.
                Err(_) if path.is_dir() => {}
                Err(e) => return Err(Error::io(path, e)),
            }
        }
        Ok(made)
    }
}

impl Drop for Made {
    fn drop(&mut self) {
        // Errors are ignored; folders that are not empty remain.
        self.0.iter().all(|made| fs::remove_dir(made).is_ok());
    }
}

/// Creates a draft and locks it. Another program may delete it before it is locked.
fn draft_in(out: &Path) -> Result<(TempDir, Option<File>)> {
    let mut draft = scratch_in(out)?;
    for _ in 0..TRIES {
        // If the system cannot lock folders, no program deletes drafts, so no lock is needed.
        let Ok(folder) = File::open(draft.path()) else {
            draft = scratch_in(out)?;
            continue;
        };
        let lock = match folder.try_lock() {
            Ok(()) => Some(folder),
            // Another program has locked the draft and is about to delete it.
            Err(TryLockError::WouldBlock) => {
                draft = scratch_in(out)?;
                continue;
            }
            Err(TryLockError::Error(_)) => None,
        };
        if draft.path().is_dir() {
            return Ok((draft, lock));
        }
        draft = scratch_in(out)?;
    }
    Ok((draft, None))
}

/// Locks a folder until the returned file is dropped or the process ends. Returns `None` if the
/// folder is already locked or the system cannot lock folders.
fn locked(folder: &Path) -> Option<File> {
    let file = File::open(folder).ok()?;
    file.try_lock().is_ok().then_some(file)
}

/// Deletes drafts of killed programs, as far as possible. The drafts of runs in progress are locked and
/// remain.
fn remove_drafts(out: &Path) {
    for entry in fs::read_dir(out).into_iter().flatten().flatten() {
        if is_unfinished(&entry.file_name())
            && is_private(&entry.path())
            // Hold the lock until the draft is deleted.
            && let Some(_lock) = locked(&entry.path())
        {
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

/// Returns whether a path is a folder (not a symbolic link to a folder) that only its owner can
/// open.
fn is_private(path: &Path) -> bool {
    path.symlink_metadata().is_ok_and(|about| {
        #[cfg(unix)]
        let private =
            std::os::unix::fs::PermissionsExt::mode(&about.permissions()) & 0o777 == 0o700;
        #[cfg(not(unix))]
        let private = true;
        about.is_dir() && private
    })
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
        let left = scratch_in(dir.path()).unwrap().keep();
        fs::write(left.join("a"), "half").unwrap();
        // Folders that are not drafts of this program: the first has another mode, the second
        // another name.
        let theirs = [".phasmid-abcdef.partial", ".phasmid-thesis1.partial"];
        let theirs = theirs.map(|name| dir.path().join(name));
        for folder in &theirs {
            fs::create_dir(folder).unwrap();
        }
        let one = OutputFolder::create(dir.path(), false).unwrap();
        assert!(!left.exists());
        let other = OutputFolder::create(dir.path(), false).unwrap();
        assert!(one.draft().exists() && other.draft().exists());
        assert!(theirs.iter().all(|folder| folder.exists()));
    }

    #[test]
    fn failure_while_files_are_moved_restores_the_earlier_result() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        for name in ["a", "marker", "stale"] {
            fs::write(out.join(name), "old").unwrap();
        }
        fs::write(out.join("sub"), "a file where a folder has to be").unwrap();
        let folder = OutputFolder::create(out, true).unwrap();
        for name in ["a", "marker"] {
            fs::write(folder.draft().join(name), "new").unwrap();
        }
        fs::create_dir(folder.draft().join("sub")).unwrap();
        fs::write(folder.draft().join("sub/b"), "new").unwrap();
        assert!(folder.finish(["stale"], Some("marker")).is_err());
        for name in ["a", "marker", "stale"] {
            assert_eq!(text(out.join(name)), "old", "{name}");
        }
        assert_eq!(count(out), 4);
    }

    #[test]
    fn inputs_are_not_replaced() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        fs::write(out.join("a"), "input").unwrap();
        let folder = OutputFolder::create(out, true).unwrap();
        let folder = folder.sparing([out.join("a")]);
        fs::write(folder.draft().join("a"), "new").unwrap();
        let refused = folder.finish([""; 0], None).unwrap_err();
        assert_eq!(refused.exit_code(), 2);
        assert_eq!(text(out.join("a")), "input");
    }

    #[test]
    fn folders_made_for_a_failed_result_are_removed() {
        let dir = tempfile::tempdir().unwrap();
        drop(OutputFolder::create(&dir.path().join("x/../y/z"), false).unwrap());
        assert_eq!(count(dir.path()), 0);
    }

    #[test]
    fn many_programs_fill_one_folder_without_a_failure() {
        let dir = tempfile::tempdir().unwrap();
        let fill = || {
            for _ in 0..50 {
                let folder = OutputFolder::create(dir.path(), true).unwrap();
                fs::write(folder.draft().join("a"), "new").unwrap();
                folder.finish([""; 0], None).unwrap();
            }
        };
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(fill);
            }
        });
        assert_eq!(count(dir.path()), 1);
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
