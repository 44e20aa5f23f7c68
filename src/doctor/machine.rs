//! The machine that is looked at: a tree of files and a user.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Most of a file that is read, in bytes; the list of a kernel's modules is the longest.
const MAX_BYTES: u64 = 16 << 20;

/// Who asks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct User {
    /// Effective user number.
    pub uid: u32,
    /// Numbers of the groups that the process has, the effective one among them.
    pub groups: Vec<u32>,
}

/// A machine as its files show it.
#[derive(Debug, Clone)]
pub struct Machine {
    /// Where its file system begins.
    pub root: PathBuf,
    /// The running kernel's release, as `uname -r` says it.
    pub release: String,
    /// Who asks.
    pub user: User,
    /// The environment says that this is a container (systemd's `container=`).
    pub container_env: bool,
    /// Where run directories are made.
    pub run_parent: PathBuf,
    /// Whether this user may read and write a path, as the system sees it (lists of access
    /// included), without opening it.
    pub access: fn(&Path, &User) -> io::Result<()>,
}

impl Machine {
    /// A path in the machine; `path` has no leading slash.
    pub(super) fn path(&self, path: impl AsRef<Path>) -> PathBuf {
        self.root.join(path)
    }

    /// A path of the machine as its user knows it.
    pub(super) fn shown(&self, path: &Path) -> String {
        match path.strip_prefix(&self.root) {
            Ok(rest) => format!("/{}", rest.display()),
            Err(_) => path.display().to_string(),
        }
    }

    /// A file's text; `None` where it cannot be read.
    pub(super) fn text(&self, path: impl AsRef<Path>) -> Option<String> {
        let mut bytes = Vec::new();
        let file = File::open(self.path(path)).ok()?;
        file.take(MAX_BYTES).read_to_end(&mut bytes).ok()?;
        Some(String::from_utf8_lossy(&bytes).into_owned())
    }

    /// A file's first line.
    pub(super) fn line(&self, path: impl AsRef<Path>) -> Option<String> {
        let text = self.text(path)?;
        Some(text.lines().next().unwrap_or_default().trim().to_owned())
    }

    /// What a folder holds, sorted; nothing where it cannot be read.
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

    /// Whether a path is there, links followed.
    pub(super) fn has(&self, path: impl AsRef<Path>) -> bool {
        self.path(path).exists()
    }

    /// Whether this looks like a container.
    pub(super) fn container(&self) -> bool {
        let marks = [".dockerenv", "run/.containerenv", "run/systemd/container"];
        self.container_env || marks.iter().any(|mark| self.has(mark))
    }

    /// The name that belongs to a number in `/etc/passwd` or `/etc/group`, or the number.
    pub(super) fn name(&self, file: &str, number: u32) -> String {
        self.entries(file)
            .into_iter()
            .find(|(_, n, _)| *n == number)
            .map_or_else(|| number.to_string(), |(name, ..)| name)
    }

    /// Name, number and the last field of each line of `/etc/passwd` or `/etc/group`.
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
