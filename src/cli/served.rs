//! Runs a device in a process of its own, for as long as a command needs it.

use phasmid_core::error::{Error, Result};
use phasmid_protocol::Endpoints;
use rustix::process::{Pid, Signal, kill_process};
use std::fs;
use std::hash::{BuildHasher, RandomState};
use std::io::Read;
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::{JoinHandle, sleep};
use std::time::{Duration, Instant};

/// Maximum time for a device to become ready, and to end.
const PATIENCE: Duration = Duration::from_secs(60);
/// Maximum time for an answer on the service channel. Frames in flight are finished first.
const ANSWER: Duration = Duration::from_secs(30);
const POLL: Duration = Duration::from_millis(5);

/// A running `phasmid serve`. Dropping this value ends it.
pub(super) struct Served {
    child: Child,
    run_dir: PathBuf,
    endpoints: Endpoints,
    /// Forwards the standard error of the device.
    words: Option<JoinHandle<()>>,
}

impl Served {
    /// Starts `phasmid serve` with these arguments for a command and waits until it is reachable.
    ///
    /// # Errors
    /// Returns an error, with the process's own message, if it cannot be started, ends, or is not ready
    /// in time.
    pub(super) fn start(command: &str, arguments: &[String]) -> Result<Self> {
        let program = std::env::current_exe().map_err(|e| Error::io("phasmid", e))?;
        // The device creates it with mode 0700, and removes it even if this process is killed. Its name
        // is unpredictable: the keys of a `RandomState` are random numbers of the system. It is short
        // because the path of a socket is limited to about a hundred bytes.
        let number = RandomState::new().hash_one(std::process::id());
        let run_dir = std::env::temp_dir().join(format!("phasmid-{command}-{number:016x}"));
        let child = Command::new(&program)
            .arg("serve")
            .args(arguments)
            // Leaves V4L2 nodes to other programs.
            .args(["--camera", "socket"])
            .arg("--run-dir")
            .arg(&run_dir)
            // Ends with this process, even if that is killed.
            .arg("--while-stdin")
            // Ctrl-C ends this process first, which then ends the device.
            .process_group(0)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| Error::io(&program, e))?;
        let mut served = Starting { child, run_dir };
        let deadline = Instant::now() + PATIENCE;
        loop {
            if let Ok(endpoints) = Endpoints::read(&served.run_dir)
                && endpoints.pid == served.child.id()
            {
                let Starting { mut child, run_dir } = served;
                let relay = |mut stderr| {
                    // Runs until the device ends. A failed write is ignored.
                    std::thread::Builder::new().spawn(move || {
                        let _ = std::io::copy(&mut stderr, &mut std::io::stderr());
                    })
                };
                let words = match child.stderr.take().map(relay).transpose() {
                    Ok(words) => words,
                    Err(e) => {
                        end(&mut child, &run_dir);
                        return Err(Error::io("a thread for messages of phasmid serve", e));
                    }
                };
                return Ok(Self {
                    child,
                    run_dir,
                    endpoints,
                    words,
                });
            }
            let ended = served
                .child
                .try_wait()
                .map_err(|e| Error::io("phasmid serve", e))?;
            if let Some(status) = ended {
                return Err(served.failure(status.code()));
            }
            if Instant::now() > deadline {
                end(&mut served.child, &served.run_dir);
                return Err(Error::device(format!(
                    "phasmid serve was not ready within {} s",
                    PATIENCE.as_secs()
                )));
            }
            sleep(POLL);
        }
    }

    pub(super) fn endpoints(&self) -> &Endpoints {
        &self.endpoints
    }

    /// Asks the device to end, and waits until it has.
    ///
    /// # Errors
    /// Returns an error if it does not end in time, or with a status other than 0.
    pub(super) fn stop(mut self) -> Result<()> {
        let status = terminate(&mut self.child);
        match status {
            Some(0) => Ok(()),
            Some(other) => Err(Error::device(format!(
                "phasmid serve ended with status {other} when asked to stop, expected 0"
            ))),
            None => Err(Error::device(
                "phasmid serve did not end when asked to stop",
            )),
        }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        end(&mut self.child, &self.run_dir);
        if let Some(words) = self.words.take() {
            // The thread ends when the pipe closes.
            let _ = words.join();
        }
    }
}

/// Connects to the device's service channel, which no physical device has.
///
/// # Errors
/// Returns an error if the socket cannot be opened.
pub(super) fn service(path: &Path) -> Result<UnixStream> {
    let io = |e| Error::io(path, e);
    let stream = UnixStream::connect(path).map_err(io)?;
    stream.set_read_timeout(Some(ANSWER)).map_err(io)?;
    stream.set_write_timeout(Some(ANSWER)).map_err(io)?;
    Ok(stream)
}

struct Starting {
    child: Child,
    run_dir: PathBuf,
}

impl Starting {
    /// Returns the child's own message as an error, with its exit status.
    fn failure(&mut self, code: Option<i32>) -> Error {
        let mut words = String::new();
        if let Some(stderr) = &mut self.child.stderr {
            // Best effort: shows as much as can be read.
            let _ = stderr.take(1 << 16).read_to_string(&mut words);
        }
        let words = words.trim().trim_start_matches("phasmid: ");
        match code {
            Some(status @ 1..=2) if !words.is_empty() => Error::Relayed {
                words: words.to_owned(),
                status: status as u8,
            },
            Some(status) => {
                Error::device(format!("phasmid serve ended with status {status}: {words}"))
            }
            None => Error::device(format!("phasmid serve was killed: {words}")),
        }
    }
}

/// Sends TERM and waits. Returns the exit status if the process ended in time.
fn terminate(child: &mut Child) -> Option<i32> {
    if let Ok(Some(status)) = child.try_wait() {
        return status.code();
    }
    if let Some(pid) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) {
        // The process may have ended since.
        let _ = kill_process(pid, Signal::TERM);
    }
    let deadline = Instant::now() + PATIENCE;
    while Instant::now() < deadline {
        if let Ok(Some(status)) = child.try_wait() {
            return status.code();
        }
        sleep(POLL);
    }
    None
}

/// Ends the process, by force if necessary, and then also removes its folder.
fn end(child: &mut Child, run_dir: &Path) {
    if terminate(child).is_none() {
        let _ = child.kill();
        let _ = child.wait();
        let _ = fs::remove_dir_all(run_dir);
    }
}
