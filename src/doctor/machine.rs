//! The examined machine, described by a tree of files and a user.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Maximum number of bytes to read from a file; the largest file is the list of a kernel's modules.
const MAX_BYTES: u64 = 16 << 20;

/// The user who runs the check.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct User {
    /// Effective user number.
    pub uid: u32,
    /// Numbers of the process's groups, including the effective group.
    pub groups: Vec<u32>,
}

/// A machine, described by its files.
#[derive(Debug, Clone)]
pub struct Machine {
    /// Root of the machine's file system.
    pub root: PathBuf,
    /// The running kernel's release, as printed by `uname -r`.
    pub release: String,
    /// The user who runs the check.
    pub user: User,
    /// Whether an environment variable marks a container (systemd's `container`).
    pub container_env: bool,
    /// Folder in which run directories are created.
    pub run_parent: PathBuf,
    /// Checks whether this user may read and write a path. Takes access control lists into account
    /// and does not open the path.
    pub access: fn(&Path, &User) -> io::Result<()>,
    /// Whether a v4l2loopback node has lost both its capture and its output side. The function
    /// opens the node, which does not disturb other programs. It returns `false` if the path is not
    /// a V4L2 device or cannot be opened.
    pub forgotten: fn(&Path) -> bool,
}

impl Machine {
    /// Returns a path in the machine's tree; `path` has no leading slash.
    pub(super) fn path(&self, path: impl AsRef<Path>) -> PathBuf {
        self.root.join(path)
    }

    /// Formats a path in the machine's tree as the machine's user knows it, without the tree's
    /// root.
    pub(super) fn shown(&self, path: &Path) -> String {
        match path.strip_prefix(&self.root) {
            Ok(rest) => format!("/{}", rest.display()),
            Err(_) => path.display().to_string(),
        }
    }

    /// Returns a file's text; `None` if it cannot be read.
    pub(super) fn text(&self, path: impl AsRef<Path>) -> Option<String> {
        let mut bytes = Vec::new();
        let file = File::open(self.path(path)).ok()?;
        file.take(MAX_BYTES).read_to_end(&mut bytes).ok()?;
        Some(String::from_utf8_lossy(&bytes).into_owned())
    }

    /// Returns the entries of a folder, sorted; empty if it cannot be read.
    pub(super) fn list(&self, folder: impl AsRef<Path>) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(self.path(folder));
        let mut paths: Vec<_> = entries
            .into_iter()
            .flatten()
            .flatten()
            .map(|entry| entry.path())
            .collect();
        paths.sort();
        paths
    }

    /// Returns whether a path exists; symbolic links are followed.
    pub(super) fn has(&self, path: impl AsRef<Path>) -> bool {
        self.path(path).exists()
    }

    /// Returns whether the machine looks like a container.
    pub(super) fn container(&self) -> bool {
        let marks = [".dockerenv", "run/.containerenv", "run/systemd/container"];
        self.container_env || marks.iter().any(|mark| self.has(mark))
    }

    /// Returns the name for a number in `/etc/passwd` or `/etc/group`, or the number if it has none.
    pub(super) fn name(&self, file: &str, number: u32) -> String {
        self.entries(file)
            .into_iter()
            .find(|(_, n, _)| *n == number)
            .map_or_else(|| number.to_string(), |(name, ..)| name)
    }

    /// Returns the name, the number and the last field of each line of `/etc/passwd` or `/etc/group`.
    pub(super) fn entries(&self, file: &str) -> Vec<(String, u32, String)> {
        let text = self.text(Path::new("etc").join(file)).unwrap_or_default();
        let line = |line: &str| {
            let mut fields = line.split(':');
            let name = fields.next()?.to_owned();
            let number = fields.nth(1)?.parse().ok()?;
            Some((
                name,
                number,
                fields.next_back().unwrap_or_default().to_owned(),
            ))
        };
        text.lines().filter_map(line).collect()
    }
}
