//! Ctrl-C, TERM and a closed terminal (HUP) during a capture: the command ends as after any other
//! failure, restores the device and removes its unfinished output. A second signal removes the
//! unfinished output and ends the program, without waiting for the device.

use phasmid_core::error::{Error, Result};
use phasmid_core::output_folder::OutputFolder;
use std::fs;
use std::io::ErrorKind;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Mutex, MutexGuard, Once, PoisonError};
use std::time::Duration;

/// Time between two checks whether a signal has come.
const POLL: Duration = Duration::from_millis(50);
/// Minimum time between the first signal and the exit that a second signal causes. Signals often
/// come in pairs: a terminal sends Ctrl-C both to a script and to this program, and the script
/// passes its signal on to this program.
const GRACE: Duration = Duration::from_millis(500);
/// Maximum number of attempts to remove a folder in which another thread still creates files.
const REMOVALS: usize = 100;
/// Exit status of a program that SIGINT has ended, as in shells: 128 + 2.
const INTERRUPTED: i32 = 130;

/// Whether a signal has come since the handlers were installed.
static ASKED: AtomicBool = AtomicBool::new(false);

/// Returns whether a signal has come, which ends captures.
pub(super) fn interrupted() -> bool {
    ASKED.load(Ordering::Relaxed)
}

/// Returns `Break` once a signal has come. The first call installs the signal handlers; from then
/// on, a signal ends captures instead of the program.
pub(super) fn flow() -> ControlFlow<()> {
    static WATCH: Once = Once::new();
    WATCH.call_once(watch);
    match interrupted() {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    }
}

/// Installs the signal handlers; from then on, a signal takes effect only at the next [`check`] or
/// [`flow`].
pub(super) fn watch_signals() {
    let _ = flow();
}

/// Returns an error if a signal has come.
///
/// # Errors
/// [`Error::Interrupted`].
pub(super) fn check() -> Result<()> {
    match interrupted() {
        true => Err(Error::Interrupted),
        false => Ok(()),
    }
}

/// Waits until another thread has computed a result or a signal arrives.
///
/// # Errors
/// Returns the error of the work, or [`Error::Interrupted`].
pub(super) fn unless_interrupted<T: Send + 'static>(
    work: impl FnOnce() -> Result<T> + Send + 'static,
) -> Result<T> {
    let (done, waiting) = mpsc::channel();
    let thread = std::thread::Builder::new().spawn(move || {
        let _ = done.send(work());
    });
    thread.map_err(|e| Error::io("a thread that waits for an answer", e))?;
    loop {
        check()?;
        match waiting.recv_timeout(POLL) {
            Ok(result) => return result,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                return Err(Error::device(
                    "the thread that waits for an answer panicked",
                ));
            }
        }
    }
}

/// Installs the signal handlers before it returns.
fn watch() {
    let (installed, waiting) = mpsc::channel();
    let thread = std::thread::Builder::new().name("signals".into());
    // If the thread or a handler cannot be created, the signals keep their default effect.
    let _ = thread.spawn(move || listen(installed));
    let _ = waiting.recv();
}

/// Handles the signals until the second one. Drops `installed` when the handlers are installed.
fn listen(installed: mpsc::Sender<()>) -> std::io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    runtime.block_on(async move {
        // Wait for the first and the second signal with the same handlers, so that no signal
        // between them is lost.
        let mut signals = Signals::install()?;
        drop(installed);
        signals.next().await;
        ASKED.store(true, Ordering::Relaxed);
        let end = tokio::time::Instant::now() + GRACE;
        // After the first signal, the scan may still wait for a port that is gone. The second
        // signal ends the program without that wait.
        signals.next().await;
        tokio::time::sleep_until(end).await;
        // Hold the lock until the exit, so that no other thread creates a folder or file.
        let remaining = remaining();
        remaining.iter().for_each(Remains::remove);
        std::process::exit(INTERRUPTED)
    })
}

/// The signals that end a command. A signal that was ignored when the program started, such as HUP under
/// `nohup`, stays ignored.
#[cfg(unix)]
pub(super) struct Signals {
    interrupt: Option<tokio::signal::unix::Signal>,
    terminate: Option<tokio::signal::unix::Signal>,
    /// Sent when the terminal closes.
    hang_up: Option<tokio::signal::unix::Signal>,
}

#[cfg(unix)]
impl Signals {
    /// Installs the handlers, inside a tokio runtime.
    ///
    /// # Errors
    /// Returns the system's error.
    pub(super) fn install() -> std::io::Result<Self> {
        use tokio::signal::unix::{SignalKind, signal};
        let ignored = ignored();
        let install = |kind: SignalKind| {
            // Bit 0 of the mask is for signal 1.
            let is_ignored = ignored >> (kind.as_raw_value() - 1) & 1 != 0;
            (!is_ignored).then(|| signal(kind)).transpose()
        };
        Ok(Self {
            interrupt: install(SignalKind::interrupt())?,
            terminate: install(SignalKind::terminate())?,
            hang_up: install(SignalKind::hangup())?,
        })
    }

    /// Waits for the next signal.
    pub(super) async fn next(&mut self) {
        async fn received(signal: &mut Option<tokio::signal::unix::Signal>) {
            match signal {
                Some(signal) => drop(signal.recv().await),
                None => std::future::pending().await,
            }
        }
        tokio::select! {
            () = received(&mut self.interrupt) => {}
            () = received(&mut self.terminate) => {}
            () = received(&mut self.hang_up) => {}
        }
    }
}

/// Returns the mask of the signals that the program ignores. Always 0 on systems other than Linux.
#[cfg(unix)]
fn ignored() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.unwrap_or_default()
}

#[cfg(not(unix))]
struct Signals;

#[cfg(not(unix))]
impl Signals {
    fn install() -> std::io::Result<Self> {
        Ok(Self)
    }

    /// Waits for the next signal.
    async fn next(&mut self) {
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending().await
        }
    }
}

/// A folder that the second signal removes.
struct Remains {
    folder: PathBuf,
    /// Folders created to hold `folder`, innermost first; removed if they are empty.
    made: Vec<PathBuf>,
}

impl Remains {
    /// Removes the folders, as far as possible.
    fn remove(&self) {
        for _ in 0..REMOVALS {
            let _ = fs::remove_dir_all(&self.folder);
            if self.folder.symlink_metadata().is_err() {
                break;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        self.made.iter().all(|made| fs::remove_dir(made).is_ok());
    }
}

/// Returns the list of folders that the second signal removes. While the returned value exists,
/// that signal does not end the program.
fn remaining() -> MutexGuard<'static, Vec<Remains>> {
    static REMAINS: Mutex<Vec<Remains>> = Mutex::new(Vec::new());
    REMAINS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Does short work, such as writing a file, that the second signal must not interrupt.
pub(super) fn uninterrupted<T>(work: impl FnOnce() -> T) -> T {
    let _no_exit = remaining();
    work()
}

/// Path of a folder that the second signal removes, until this value is dropped.
pub(super) struct RemovedAtExit(PathBuf);

impl Drop for RemovedAtExit {
    fn drop(&mut self) {
        remaining().retain(|remains| remains.folder != self.0);
    }
}

/// Makes the second signal remove the private run directory of a device, which is the folder of the
/// device's control port.
#[cfg(target_os = "linux")]
pub(super) fn remove_run_dir_at_exit(control: &Path) -> Option<RemovedAtExit> {
    let folder = control.parent()?.to_owned();
    remaining().push(Remains {
        folder: folder.clone(),
        made: Vec::new(),
    });
    Some(RemovedAtExit(folder))
}

/// An output folder that is being filled. The second signal removes its draft.
pub(super) struct Unfinished {
    // Dropped first, so that the draft is removed while it is still registered in `draft`.
    folder: OutputFolder,
    draft: RemovedAtExit,
}

impl Unfinished {
    /// Creates the folder and its draft, as [`OutputFolder::create`] does. `option` is the option
    /// that names the folder.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be created or written.
    pub(super) fn create(option: &str, out: &Path, force: bool) -> Result<Self> {
        let mut remaining = remaining();
        let made = out.ancestors().filter(|path| path.file_name().is_some());
        let made = made.filter(|path| path.symlink_metadata().is_err());
        let made = made.map(Path::to_owned).collect();
        let folder =
            OutputFolder::create(out, force).map_err(|why| unwritable(option, out, why))?;
        let draft = folder.draft().to_owned();
        remaining.push(Remains {
            folder: draft.clone(),
            made,
        });
        Ok(Self {
            folder,
            draft: RemovedAtExit(draft),
        })
    }

    /// Adds files that are not replaced, see [`OutputFolder::sparing`].
    #[must_use]
    pub(super) fn sparing(self, inputs: impl IntoIterator<Item = impl AsRef<Path>>) -> Self {
        Self {
            folder: self.folder.sparing(inputs),
            ..self
        }
    }

    /// Returns the folder to write files and subfolders to.
    pub(super) fn draft(&self) -> &Path {
        self.folder.draft()
    }

    /// Moves the files of one subfolder now, see [`OutputFolder::keep`].
    ///
    /// # Errors
    /// Returns an error if a file cannot be moved.
    pub(super) fn keep(&self, subfolder: &str) -> Result<()> {
        let _no_exit = remaining();
        self.folder.keep(subfolder)
    }

    /// Moves all files, see [`OutputFolder::finish`].
    ///
    /// # Errors
    /// Returns an error if a file cannot be moved.
    pub(super) fn finish(
        self,
        earlier: impl IntoIterator<Item = impl AsRef<Path>>,
        marker: Option<&str>,
    ) -> Result<()> {
        let Self { folder, draft } = self;
        let no_exit = remaining();
        let moved = folder.finish(earlier, marker);
        drop(no_exit);
        drop(draft);
        moved
    }
}

/// Converts the system's refusal to create files in a folder to a mistake in an option. A full disk
/// remains a failure of the system.
fn unwritable(option: &str, out: &Path, why: Error) -> Error {
    match why {
        Error::Io { source, .. } if source.kind() != ErrorKind::StorageFull => Error::input(
            format!("{option} {}", out.display()),
            format!("cannot create files in this folder: {source}"),
            "a writable folder, or a path where one can be created",
        ),
        why => why.at(option),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(folder: &Path) -> usize {
        fs::read_dir(folder).unwrap().count()
    }

    /// Removes folders as the second signal would, limited to those in `out`.
    fn exit(out: &Path) {
        let remaining = remaining();
        let of_out = |remains: &&Remains| remains.folder.starts_with(out);
        remaining.iter().filter(of_out).for_each(Remains::remove);
    }

    #[test]
    fn second_signal_removes_the_draft_and_the_folders_made_for_it() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("x/y");
        let unfinished = Unfinished::create("--out", &out, false).unwrap();
        fs::create_dir(unfinished.draft().join("captures")).unwrap();
        fs::write(unfinished.draft().join("captures/a"), "half").unwrap();
        exit(&out);
        assert_eq!(count(dir.path()), 0);
        drop(unfinished);

        let unfinished = Unfinished::create("--out", dir.path(), false).unwrap();
        fs::write(dir.path().join("mine"), "mine").unwrap();
        fs::write(unfinished.draft().join("a"), "new").unwrap();
        unfinished.finish([""; 0], None).unwrap();
        exit(dir.path());
        assert_eq!(count(dir.path()), 2, "finished files stay");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn folder_that_cannot_be_made_is_a_mistake_in_the_option() {
        // The kernel does not allow folders to be created under /proc, not even by root.
        let out = Path::new("/proc/phasmid/out");
        let refused = Unfinished::create("--out", out, false).err().unwrap();
        assert_eq!(refused.exit_code(), 2);
        let words = refused.to_string();
        let start = "--out /proc/phasmid/out: cannot create files in this folder: ";
        assert!(words.starts_with(start), "{words}");
    }
}
