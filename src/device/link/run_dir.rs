//! The run directory of a served device. Its mode is `0700` while the device runs; the earlier state
//! of the directory is restored when the device ends.
//!
//! A lock on the directory marks it as in use; the system releases it even if the process is
//! killed. Files left by a killed device are recognised by name, kind and content, and removed.

use phasmid_core::error::{Error, Result};
use phasmid_core::new_file::{is_unfinished, write};
use phasmid_protocol::Endpoints;
use phasmid_protocol::endpoints;
use rustix::fs::{FlockOperation, Mode, OFlags};
use std::fs;
use std::io::Write;
use std::os::fd::OwnedFd;
use std::os::unix::fs::{DirBuilderExt, FileTypeExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// Name of the control port.
pub(super) const CONTROL: &str = "control";
/// Name of the camera's frame socket.
pub(super) const CAMERA: &str = "camera.sock";
/// Name of the service socket.
pub(super) const SERVICE: &str = "service.sock";

/// Maximum length of a Unix socket's path on Linux, without the terminating zero.
const MAX_SOCKET_PATH: usize = 107;

/// A claimed run directory. Dropping it removes the files that the device made in it, and the
/// directory itself if the device created it.
#[derive(Debug)]
pub struct RunDir {
    path: PathBuf,
    made: bool,
    /// Mode to restore if the directory existed before it was claimed.
    mode: Option<u32>,
    files: Vec<PathBuf>,
    _lock: OwnedFd,
}

impl RunDir {
    /// Claims a directory: creates it, or takes over an empty directory or one left by a killed
    /// device.
    ///
    /// # Errors
    /// Returns an error if another device uses the directory, if it belongs to another user or
    /// holds files that are not a device's, or if the system refuses.
    pub fn claim(path: &Path) -> Result<Self> {
        let place = path.display();
        let io = |e: std::io::Error| Error::io(path, e);
        if path.as_os_str().len() + 1 + SERVICE.len() > MAX_SOCKET_PATH {
            return Err(Error::input(
                format!("--run-dir {place}"),
                format!("a path of {} bytes", path.as_os_str().len()),
                format!(
                    "up to {} bytes, for the sockets in it",
                    MAX_SOCKET_PATH - 1 - SERVICE.len()
                ),
            ));
        }
        let made = match fs::DirBuilder::new().mode(0o700).create(path) {
            Ok(()) => true,
            Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => false,
            Err(e) => return Err(io(e)),
        };
        // Does not follow links, because in a shared temporary directory anybody could have created
        // one.
        let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
        let lock = rustix::fs::open(path, flags, Mode::empty()).map_err(|e| io(e.into()))?;
        let stat = rustix::fs::fstat(&lock).map_err(|e| io(e.into()))?;
        let refuse = |found: &str| {
            Err(Error::input(
                format!("--run-dir {place}"),
                found,
                "a new or empty directory that you own, or one that a device left behind",
            ))
        };
        if stat.st_uid != rustix::process::geteuid().as_raw() {
            return refuse("a directory of another user");
        }
        if rustix::fs::flock(&lock, FlockOperation::NonBlockingLockExclusive).is_err() {
            return refuse(&match Endpoints::read(path) {
                Ok(other) => format!("process {} serves a device from it", other.pid),
                Err(_) => "a device is being served from it".to_owned(),
            });
        }
        // The directory may have been removed by its last user between creation and lock.
        let same = fs::symlink_metadata(path).is_ok_and(|now| now.ino() == stat.st_ino);
        if !same {
            return refuse("a directory that is being removed; try again");
        }
        let mut dir = Self {
            path: path.to_path_buf(),
            made,
            mode: None,
            files: Vec::new(),
            _lock: lock,
        };
        let Some(leftovers) = dir.leftovers().map_err(io)? else {
            return refuse("files that are not a device's");
        };
        for leftover in leftovers {
            fs::remove_file(&leftover).map_err(|e| Error::io(&leftover, e))?;
            // A directory left by a killed device is removed at the end, as if this device had
            // created it.
            dir.made |= stat.st_mode & 0o777 == 0o700;
        }
        if stat.st_mode & 0o777 != 0o700 {
            fs::set_permissions(path, fs::Permissions::from_mode(0o700)).map_err(io)?;
            dir.mode = Some(stat.st_mode & 0o777);
        }
        Ok(dir)
    }

    /// Lists the files of the directory; `None` if it contains a file that no device leaves behind.
    fn leftovers(&self) -> std::io::Result<Option<Vec<PathBuf>>> {
        let mut found = Vec::new();
        for entry in fs::read_dir(&self.path)? {
            let entry = entry?;
            let kind = entry.file_type()?;
            let name = entry.file_name();
            let ours = match name.to_str() {
                Some(CONTROL) => kind.is_symlink(),
                Some(CAMERA | SERVICE) => kind.is_socket(),
                Some(endpoints::FILE_NAME) => kind.is_file() && Endpoints::read(&self.path).is_ok(),
                _ => kind.is_file() && is_unfinished(&name),
            };
            if !ours {
                return Ok(None);
            }
            found.push(entry.path());
        }
        Ok(Some(found))
    }

    /// Returns the path of the directory.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the path of a file to be created in the directory and removed together with it.
    pub(super) fn file(&mut self, name: &str) -> PathBuf {
        let path = self.path.join(name);
        self.files.push(path.clone());
        path
    }

    /// Writes `device.json` atomically and replaces an earlier version. It is written when all the
    /// ports and sockets that it names can be used.
    pub(super) fn publish(&mut self, endpoints: &Endpoints) -> Result<()> {
        let text = serde_json::to_string_pretty(endpoints).map_err(|why| {
            let place = format!("--run-dir {}", self.path.display());
            Error::input(place, why, "a path in UTF-8, which device.json can hold")
        })?;
        let path = self.path.join(endpoints::FILE_NAME);
        let again = self.files.contains(&path);
        if !again {
            self.files.push(path.clone());
        }
        write(&path, again, |file| writeln!(file, "{text}"))
    }
}

impl Drop for RunDir {
    fn drop(&mut self) {
        // Best effort: errors cannot be reported any more.
        for file in self.files.iter().rev() {
            let _ = fs::remove_file(file);
        }
        if self.made {
            let _ = fs::remove_dir(&self.path);
        } else if let Some(mode) = self.mode {
            let _ = fs::set_permissions(&self.path, fs::Permissions::from_mode(mode));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::net::UnixListener;

    fn endpoints(pid: u32) -> Endpoints {
        Endpoints {
            name: "a,b,c,d".into(),
            pid,
            profile: Some("p".into()),
            scene: Some("s".into()),
            seed: Some(1),
            clock: None,
            slowdown: None,
            control: "control".into(),
            dialect: None,
            baud: None,
            camera: "socket:camera.sock".into(),
            camera_socket: "socket:camera.sock".into(),
            camera_tcp: None,
            control_usb: None,
            usb: None,
            service: "service.sock".into(),
        }
    }

    fn mode(path: &Path) -> u32 {
        fs::metadata(path).unwrap().mode() & 0o777
    }

    #[test]
    fn new_directory_is_created_and_removed() {
        let base = tempfile::tempdir().unwrap();
        let path = base.path().join("run");
        let mut dir = RunDir::claim(&path).unwrap();
        assert_eq!(mode(&path), 0o700);
        dir.publish(&endpoints(7)).unwrap();
        assert_eq!(Endpoints::read(&path).unwrap(), endpoints(7));
        let slow = Endpoints {
            slowdown: Some(3.8),
            ..endpoints(7)
        };
        dir.publish(&slow).unwrap();
        assert_eq!(Endpoints::read(&path).unwrap(), slow);
        let message = RunDir::claim(&path).unwrap_err().to_string();
        assert!(message.contains("process 7 serves"), "{message}");
        drop(dir);
        assert!(!path.exists());
    }

    #[test]
    fn empty_directory_is_restored() {
        let base = tempfile::tempdir().unwrap();
        let path = base.path().join("run");
        fs::create_dir(&path).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
        let mut dir = RunDir::claim(&path).unwrap();
        assert_eq!(mode(&path), 0o700);
        dir.publish(&endpoints(7)).unwrap();
        drop(dir);
        assert_eq!(mode(&path), 0o755);
        assert_eq!(fs::read_dir(&path).unwrap().count(), 0);
    }

    #[test]
    fn clears_only_remains_of_a_killed_device() {
        let base = tempfile::tempdir().unwrap();
        let path = base.path().join("run");
        fs::DirBuilder::new().mode(0o700).create(&path).unwrap();
        let leave = || {
            std::os::unix::fs::symlink("/dev/pts/999999", path.join(CONTROL)).unwrap();
            drop(UnixListener::bind(path.join(CAMERA)).unwrap());
            let text = serde_json::to_string(&endpoints(7)).unwrap();
            fs::write(path.join(endpoints::FILE_NAME), &text[..]).unwrap();
            fs::write(path.join(".phasmid-abcdef.partial"), &text[..9]).unwrap();
        };
        leave();
        let dir = RunDir::claim(&path).unwrap();
        assert_eq!(fs::read_dir(&path).unwrap().count(), 0);
        drop(dir);
        assert!(!path.exists(), "the killed device had created the folder");

        fs::DirBuilder::new().mode(0o700).create(&path).unwrap();
        leave();
        let count = || fs::read_dir(&path).unwrap().count();
        let all = count();
        for (name, text) in [("thesis.tex", "years of work"), ("device.json", "{}")] {
            fs::write(path.join(name), text).unwrap();
            let error = RunDir::claim(&path).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            assert_eq!(fs::read_to_string(path.join(name)).unwrap(), text);
            fs::remove_file(path.join(name)).unwrap();
            assert!(count() >= all - 1, "nothing else was removed");
        }
    }

    #[test]
    fn refuses_paths_that_are_too_long_or_no_directory() {
        let base = tempfile::tempdir().unwrap();
        let file = base.path().join("file");
        fs::write(&file, "").unwrap();
        assert!(RunDir::claim(&file).is_err());
        let link = base.path().join("link");
        std::os::unix::fs::symlink(base.path(), &link).unwrap();
        assert!(RunDir::claim(&link).is_err());
        let long = base.path().join("x".repeat(120));
        assert_eq!(RunDir::claim(&long).unwrap_err().exit_code(), 2);
    }
}
