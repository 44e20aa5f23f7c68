//! A device served for a test.

use phasmid::host::{Instrument, SerialPort};
use phasmid::protocol::Endpoints;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Time limit for waits; normal replies take milliseconds.
pub const LONG: Duration = Duration::from_secs(60);

/// A served device; dropping this value stops it.
pub struct Served {
    pub child: Child,
    pub dir: PathBuf,
    pub at: Endpoints,
    _base: tempfile::TempDir,
}

pub fn phasmid() -> Command {
    Command::new(env!("CARGO_BIN_EXE_phasmid"))
}

/// Returns the command `phasmid serve` for the device and scene that all tests use.
pub fn serve() -> Command {
    let mut command = phasmid();
    command.args(["serve", "--profile", "webcam-grey", "--scene", "plane"]);
    command
}

pub fn text(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr].concat()).into_owned()
}

impl Served {
    /// Serves on a fast clock, and waits until the device is up.
    pub fn start(args: &[&str]) -> Self {
        Self::spawn(serve().args(args))
    }

    /// Same as [`Self::start`], for a command that sets neither clock nor run directory.
    pub fn spawn(command: &mut Command) -> Self {
        Self::spawn_as_it_is(command.args(["--clock", "fast"]))
    }

    /// Same as [`Self::start`], for a command that sets the clock but not the run directory.
    pub fn spawn_as_it_is(command: &mut Command) -> Self {
        let base = tempfile::tempdir().unwrap();
        let dir = base.path().join("run");
        let mut child = command
            .arg("--run-dir")
            .arg(&dir)
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        let at = come_up(&mut child, &dir);
        Self {
            child,
            dir,
            at,
            _base: base,
        }
    }

    pub fn instrument(&self) -> Instrument<SerialPort> {
        let port = SerialPort::open(self.at.control.to_str().unwrap()).unwrap();
        Instrument::open(port, LONG).unwrap()
    }

    pub fn scan(&self, out: &Path, args: &[&str]) -> Output {
        phasmid()
            .args(["scan", "--camera", &self.at.camera, "--control"])
            .arg(&self.at.control)
            .arg("--out")
            .arg(out)
            .args(args)
            .output()
            .unwrap()
    }

    pub fn stop(mut self, signal: rustix::process::Signal) {
        let pid = rustix::process::Pid::from_child(&self.child);
        rustix::process::kill_process(pid, signal).unwrap();
        let status = self.child.wait().unwrap();
        assert_eq!(status.code(), Some(0), "{status}");
        assert!(!self.dir.exists(), "nothing is left behind");
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Waits until a device reports its endpoints, and returns them.
fn come_up(child: &mut Child, dir: &Path) -> Endpoints {
    let end = Instant::now() + LONG;
    while !dir.join("device.json").exists() {
        if Instant::now() >= end {
            let _ = child.kill();
            panic!("the device does not start");
        }
        assert!(
            child.try_wait().unwrap().is_none(),
            "the device disconnected"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
    Endpoints::read(dir).unwrap()
}
