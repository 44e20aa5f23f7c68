//! Creates output files atomically. A file is new or, on request, replaces an existing file.
//!
//! A file is written under an unpredictable temporary name in the same folder and renamed when it
//! is complete. A full disk or a crash therefore leaves no truncated file, and symbolic links are
//! never followed.

use crate::error::{Error, Result};
use std::ffi::OsStr;
use std::fs::File;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use tempfile::{NamedTempFile, TempPath};

const PREFIX: &str = ".phasmid-";
const SUFFIX: &str = ".partial";
/// Length of the random part of a temporary name, between prefix and suffix.
const RANDOM: usize = 6;

/// Checks that a path can be written, before any work is done for it.
///
/// # Errors
/// Returns an error if the path exists (even as a dangling link) and `force` is not set, if it is
/// not a regular file, or if its folder does not exist.
pub fn check(path: &Path, force: bool) -> Result<()> {
    let refuse = |found, allowed| Err(Error::input(path.display(), found, allowed));
    // Never replace a device or a pipe, nor a link to a device or pipe, such as /dev/stdout.
    if path.metadata().is_ok_and(|about| !about.is_file()) {
        return refuse("not a regular file", "a file, not a folder, pipe or device");
    }
    if !force && path.symlink_metadata().is_ok() {
        return Err(exists(path));
    }
    if path.file_name().is_none() {
        return refuse("no file name", "the path of a file to write");
    }
    if !folder_of(path).is_dir() {
        return Err(Error::input(
            path.display(),
            format!("no folder {}", folder_of(path).display()),
            "a file in an existing folder",
        ));
    }
    Ok(())
}

/// Checks that a folder can take the output files `names`, before any work is done for them. The
/// folder need not exist.
///
/// # Errors
/// Returns an error if the path or one of its parents is not a folder, if any of the files exists
/// (even as a dangling link) and `force` is not set, or if any of them is not a regular file.
pub fn check_folder(
    folder: &Path,
    names: impl IntoIterator<Item = impl AsRef<Path>>,
    force: bool,
) -> Result<()> {
    let place = || format!("--out {}", folder.display());
    let existing = folder.ancestors().find(|p| p.symlink_metadata().is_ok());
    if let Some(path) = existing.filter(|path| !path.is_dir()) {
        let found = match path == folder {
            true => "a file".to_owned(),
            false => format!("{}, a file", path.display()),
        };
        let allowed = "a folder, or a path where one can be created";
        return Err(Error::input(place(), found, allowed));
    }
    for name in names {
        let name = name.as_ref();
        let path = folder.join(name);
        let (found, allowed) = if path.symlink_metadata().is_err() {
            continue;
        } else if path.metadata().is_ok_and(|about| !about.is_file()) {
            ("which is not a regular file", "another folder")
        } else if !force {
            ("which exists", "another folder, or --force to overwrite")
        } else {
            continue;
        };
        let found = format!("{}, {found}", name.display());
        return Err(Error::input(place(), found, allowed));
    }
    Ok(())
}

/// An output file being written. It appears under its final name when [`Self::finish`] is called;
/// if the value is dropped without that, the file is deleted.
pub struct NewFile {
    path: PathBuf,
    force: bool,
    writer: BufWriter<File>,
    partial: TempPath,
}

impl NewFile {
    /// Starts to write a file. An existing file is replaced only with `force`.
    ///
    /// # Errors
    /// Returns an error if [`check`] fails or the temporary file cannot be created.
    pub fn create(path: &Path, force: bool) -> Result<Self> {
        check(path, force)?;
        let (file, partial) = beside(path).map_err(|e| Error::io(path, e))?.into_parts();
        Ok(Self {
            path: path.to_owned(),
            force,
            writer: BufWriter::with_capacity(1 << 18, file),
            partial,
        })
    }

    /// Renames the completed file to its final name.
    ///
    /// # Errors
    /// Returns an error if another program has created the file meanwhile and `force` is not set,
    /// or if writing or renaming fails.
    pub fn finish(mut self) -> Result<()> {
        let path = &self.path;
        self.writer.flush().map_err(|e| Error::io(path, e))?;
        drop(self.writer);
        put(self.partial, path, self.force)
    }
}

/// Gives a temporary file its final name.
fn put(partial: TempPath, path: &Path, force: bool) -> Result<()> {
    let moved = match force {
        true => partial.persist(path),
        false => partial.persist_noclobber(path),
    };
    moved.map_err(|e| match e.error.kind() {
        ErrorKind::AlreadyExists => exists(path),
        _ => Error::io(path, e.error),
    })
}

impl Write for NewFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.writer.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.writer.flush()
    }
}

/// Writes a file. An existing file is replaced only with `force`.
///
/// # Errors
/// Returns an error if [`check`] fails or the file cannot be written. Then no partial file remains,
/// and an existing file is unchanged.
pub fn write(
    path: &Path,
    force: bool,
    fill: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>,
) -> Result<()> {
    let mut file = NewFile::create(path, force)?;
    fill(&mut file.writer).map_err(|e| Error::io(path, e))?;
    file.finish()
}

/// Writes a file and replaces an existing one, for files in a folder that [`check_folder`] has
/// accepted.
///
/// # Errors
/// Returns the errors of [`write()`].
pub fn replace(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>,
) -> Result<()> {
    write(path, true, fill)
}

/// Writes an image file, replacing an existing one like [`replace`].
///
/// # Errors
/// Returns the errors of [`write()`].
pub fn replace_image(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> image::ImageResult<()>,
) -> Result<()> {
    write_image(path, true, fill)
}

/// Writes an image file. An existing file is replaced only with `force`.
///
/// # Errors
/// Returns the errors of [`write()`].
pub fn write_image(
    path: &Path,
    force: bool,
    fill: impl FnOnce(&mut BufWriter<File>) -> image::ImageResult<()>,
) -> Result<()> {
    write(path, force, |out| {
        fill(out).map_err(|e| match e {
            image::ImageError::IoError(e) => e,
            e => std::io::Error::other(e),
        })
    })
}

/// Moves a completed file to its final name on the same file system. An existing file is replaced
/// only with `force`.
///
/// # Errors
/// Returns an error if [`check`] fails or the file cannot be moved. If moving fails, the completed file
/// is deleted.
pub fn rename(from: &Path, to: &Path, force: bool) -> Result<()> {
    check(to, force)?;
    let from = TempPath::try_from_path(from).map_err(|e| Error::io(from, e))?;
    put(from, to, force)
}

/// Creates a file directly under its final name, for data that is appended during a long
/// measurement. Partial data remains after a failure, and other programs may read the file while it
/// grows.
///
/// # Errors
/// Returns an error if [`check`] fails or the file cannot be opened.
pub fn stream(path: &Path, force: bool) -> Result<File> {
    check(path, force)?;
    let io = |e| Error::io(path, e);
    if force && path.symlink_metadata().is_ok() {
        let file = beside(path).map_err(io)?;
        return file.persist(path).map_err(|e| io(e.error));
    }
    File::create_new(path).map_err(|e| match e.kind() {
        ErrorKind::AlreadyExists => exists(path),
        _ => io(e),
    })
}

/// Returns whether a name belongs to a temporary file or folder left by a killed program.
pub fn is_unfinished(name: &OsStr) -> bool {
    let name = name.to_string_lossy();
    let random = name
        .strip_prefix(PREFIX)
        .and_then(|rest| rest.strip_suffix(SUFFIX));
    random.is_some_and(|random| {
        random.len() == RANDOM && random.bytes().all(|byte| byte.is_ascii_alphanumeric())
    })
}

/// Creates a private folder with an unpredictable name in the system's temporary folder. It is
/// deleted when the value is dropped.
///
/// # Errors
/// Returns an error if the folder cannot be created.
#[cfg(target_os = "linux")]
pub fn scratch(prefix: &str) -> Result<tempfile::TempDir> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(prefix);
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o700));
    builder
        .tempdir()
        .map_err(|e| Error::io(std::env::temp_dir(), e))
}

/// Creates a private folder with an unpredictable name in a folder, for output that is moved when it
/// is complete. It is deleted when the value is dropped.
///
/// # Errors
/// Returns an error if the folder cannot be created.
pub fn scratch_in(folder: &Path) -> Result<tempfile::TempDir> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX).rand_bytes(RANDOM);
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o700));
    builder.tempdir_in(folder).map_err(|e| Error::io(folder, e))
}

/// Creates a temporary file in the same folder as `path`; it is deleted unless it is renamed.
fn beside(path: &Path) -> std::io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX).rand_bytes(RANDOM);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Apply the umask as for any new file; tempfile's default is mode 0600.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder_of(path))
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

fn exists(path: &Path) -> Error {
    Error::input(
        path.display(),
        "an existing file",
        "a new file, or --force to overwrite",
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// Sorted names of the entries of a folder.
    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort_unstable();
        names
    }

    #[test]
    fn replaces_only_when_asked_to() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.ply");
        let put = |force, text: &str| write(&path, force, |out| out.write_all(text.as_bytes()));
        put(false, "old").unwrap();
        let refused = put(false, "new").unwrap_err();
        assert_eq!(refused.exit_code(), 2);
        assert!(refused.to_string().contains("--force"), "{refused}");
        assert_eq!(fs::read(&path).unwrap(), b"old");
        put(true, "new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        drop(stream(&path, true).unwrap());
        assert_eq!(fs::read(&path).unwrap(), b"");
        assert_eq!(stream(&path, false).unwrap_err().exit_code(), 2);
        assert_eq!(names(dir.path()), ["a.ply"]);
    }

    #[test]
    fn failed_write_keeps_old_file_and_leaves_no_temporary_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.ply");
        for (force, left) in [(false, vec![]), (true, vec!["a.ply"])] {
            if force {
                fs::write(&path, "old").unwrap();
            }
            let failed = write(&path, force, |out| {
                out.write_all(b"ne")?;
                out.flush()?;
                Err(std::io::Error::other("disk full"))
            });
            assert!(failed.unwrap_err().to_string().contains("disk full"));
            assert_eq!(names(dir.path()), left);
        }
        assert_eq!(fs::read(&path).unwrap(), b"old");
    }

    #[test]
    fn file_created_during_the_write_is_kept() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        let refused = write(&path, false, |_| fs::write(&path, "theirs"));
        assert_eq!(refused.unwrap_err().exit_code(), 2);
        assert_eq!(fs::read(&path).unwrap(), b"theirs");
        assert_eq!(names(dir.path()), ["a"]);
    }

    #[test]
    fn rename_replaces_only_when_asked_to() {
        let dir = tempfile::tempdir().unwrap();
        let (from, to) = (dir.path().join("from"), dir.path().join("to"));
        fs::write(&from, "new").unwrap();
        rename(&from, &to, false).unwrap();
        fs::write(&from, "newer").unwrap();
        assert_eq!(rename(&from, &to, false).unwrap_err().exit_code(), 2);
        assert_eq!(fs::read(&to).unwrap(), b"new");
        rename(&from, &to, true).unwrap();
        assert_eq!(fs::read(&to).unwrap(), b"newer");
        assert_eq!(names(dir.path()), ["to"]);
    }

    #[test]
    fn folder_check_rejects_what_cannot_be_written() {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir(dir.path().join("cloud.ply")).unwrap();
        fs::write(dir.path().join("file"), "mine").unwrap();
        for force in [false, true] {
            let why = |folder: &str, name: &str| {
                let refused = check_folder(&dir.path().join(folder), [name], force);
                refused.unwrap_err().to_string()
            };
            let folder = why("", "cloud.ply");
            assert!(folder.contains("cloud.ply, which is not a"), "{folder}");
            let below = why("file/a/b", "cloud.ply");
            assert!(below.contains("file, a file"), "{below}");
            check_folder(&dir.path().join("a/b"), ["cloud.ply"], force).unwrap();
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn scratch_folders_are_new_private_and_removed() {
        use std::os::unix::fs::PermissionsExt;
        let base = tempfile::tempdir().unwrap();
        let some = || [scratch("phasmid-x-"), scratch_in(base.path())].map(Result::unwrap);
        for (one, other) in some().into_iter().zip(some()) {
            assert_ne!(one.path(), other.path());
            let mode = one.path().metadata().unwrap().permissions().mode();
            assert_eq!(mode & 0o777, 0o700);
            let path = one.path().to_owned();
            fs::write(path.join("file"), "text").unwrap();
            drop(one);
            assert!(!path.exists());
        }
    }

    #[cfg(unix)]
    #[test]
    fn follows_no_link_and_replaces_no_device() {
        use std::os::unix::fs::symlink;
        let dir = tempfile::tempdir().unwrap();
        let (link, target) = (dir.path().join("link"), dir.path().join("target"));
        symlink(&target, &link).unwrap();
        let put = |force| write(&link, force, |out| out.write_all(b"text"));
        assert_eq!(put(false).unwrap_err().exit_code(), 2);
        assert!(stream(&link, false).is_err());
        assert!(check_folder(dir.path(), ["link"], false).is_err());
        check_folder(dir.path(), ["link"], true).unwrap();
        assert!(check_folder(&link, [""; 0], true).is_err());
        put(true).unwrap();
        assert!(!target.exists(), "it was written through the link");
        assert!(link.symlink_metadata().unwrap().is_file());
        for other in [dir.path(), Path::new("/dev/null"), Path::new("/dev/stdout")] {
            if other.metadata().is_ok_and(|about| !about.is_file()) {
                assert_eq!(check(other, true).unwrap_err().exit_code(), 2);
            }
        }
        fs::create_dir(dir.path().join("folder")).unwrap();
        let folder = check(&dir.path().join("absent/file"), true).unwrap_err();
        assert!(folder.to_string().contains("no folder"), "{folder}");
    }
}
