//! A device in a process of its own, for as long as a command needs it.

use phasmid_core::error::{Error, Result};
use phasmid_protocol::Endpoints;
use rustix::process::{Pid, Signal, kill_process};
use std::fs;
use std::hash::{BuildHasher, RandomState};
use std::io::Read;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::{JoinHandle, sleep};
use std::time::{Duration, Instant};

/// How long a device may take to be ready, and to go away.
const PATIENCE: Duration = Duration::from_secs(60);
/// How long it may take to answer on its service channel: frames under way are finished first.
const ANSWER: Duration = Duration::from_secs(30);
const POLL: Duration = Duration::from_millis(5);

/// A running `phasmid serve`; it ends with this value.
pub(super) struct Served {
    child: Child,
    run_dir: PathBuf,
    endpoints: Endpoints,
    /// Hands on what the device says.
    words: Option<JoinHandle<()>>,
}

impl Served {
    /// Starts `phasmid serve` with these arguments for a command and waits until it can be reached.
    ///
    /// # Errors
    /// A process that cannot be started, ends, or is not ready in time; with its own words.
    pub(super) fn start(command: &str, arguments: &[String]) -> Result<Self> {
        let program = std::env::current_exe().map_err(|e| Error::io("phasmid", e))?;
        // The device makes it, 0700, and removes it even where this process is killed. Its name cannot
        // be foreseen: the keys of a `RandomState` are the system's random numbers. It is short because
        // the path of a socket has room for some hundred bytes.
        let number = RandomState::new().hash_one(std::process::id());
        let run_dir = std::env::temp_dir().join(format!("phasmid-{command}-{number:016x}"));
        let child = Command::new(&program)
            .arg("serve")
            .args(arguments)
            // A node for other programs is not for this to take.
            .args(["--camera", "socket"])
            .arg("--run-dir")
            .arg(&run_dir)
            // It ends when this process does, however that happens.
            .arg("--while-stdin")
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
                let words = child.stderr.take().map(|mut stderr| {
                    // Until the device ends; nobody is told where nobody listens.
                    std::thread::spawn(move || {
                        let _ = std::io::copy(&mut stderr, &mut std::io::stderr());
                    })
                });
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

    /// Asks the device to go, and waits until it has.
    ///
    /// # Errors
    /// A device that does not end well.
    pub(super) fn stop(mut self) -> Result<()> {
        let status = terminate(&mut self.child);
        match status {
            Some(0) => Ok(()),
            Some(other) => Err(Error::device(format!(
                "phasmid serve ended with status {other} when asked to stop, want 0"
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
            // Its end is the pipe's.
            let _ = words.join();
        }
    }
}

/// The device's service channel, which no physical device has.
///
/// # Errors
/// What the system refuses.
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
    /// The child's own message; a user's mistake stays one.
    fn failure(&mut self, code: Option<i32>) -> Error {
        let mut words = String::new();
        if let Some(stderr) = &mut self.child.stderr {
            // What can be read is shown; nothing more can be done here.
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

/// TERM, then patience; the exit status if it ended in time.
fn terminate(child: &mut Child) -> Option<i32> {
    if let Ok(Some(status)) = child.try_wait() {
        return status.code();
    }
    if let Some(pid) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) {
        // It may have gone by itself meanwhile.
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

/// Leaves neither a process nor a folder behind, whatever happened.
fn end(child: &mut Child, run_dir: &Path) {
    if terminate(child).is_none() {
        let _ = child.kill();
        let _ = child.wait();
        let _ = fs::remove_dir_all(run_dir);
    }
}
