//! A device is served for a long time with a fast clock: any number of triggers and clients leaks no
//! memory, descriptors, threads or files.
//!
//! The ordinary run is a hundredth of the full run, which is marked `#[ignore]`: `cargo test
//! --release --test end_to_end -- --ignored --nocapture soak::` prints the figures that it measures.
#![cfg(target_os = "linux")]

use phasmid::host::{Instrument, SerialPort};
use phasmid::pattern::{ManifestFrame, Pattern};
use phasmid::profile::Profile;
use phasmid::protocol::Endpoints;
use phasmid::protocol::wire::FrameDecoder;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// Number of triggers sent in one line.
const BATCH: u64 = 100;
/// Maximum time for an answer or a frame.
const PATIENCE: Duration = Duration::from_secs(30);
/// Maximum growth of memory in kB from the end of the first hundredth of the run to the end; not
/// zero, because allocators round sizes up.
const GROWTH_KB: u64 = 1024;

/// Resources that a process holds.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Held {
    memory_kb: u64,
    descriptors: usize,
    threads: usize,
    files: usize,
}

/// A served device with a sensor so small that rendering takes no time.
struct Device {
    child: Child,
    at: Endpoints,
    dir: PathBuf,
    _base: tempfile::TempDir,
}

impl Device {
    fn start() -> Self {
        let base = tempfile::tempdir().unwrap();
        let profile = base.path().join("tiny.toml");
        fs::write(&profile, toml::to_string(&tiny()).unwrap()).unwrap();
        let dir = base.path().join("run");
        let mut child = Command::new(env!("CARGO_BIN_EXE_phasmid"))
            .args(["serve", "--scene", "plane", "--camera", "socket"])
            .args(["--clock", "fast", "--profile"])
            .arg(&profile)
            .arg("--run-dir")
            .arg(&dir)
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        let deadline = Instant::now() + Duration::from_secs(30);
        let at = loop {
            if let Ok(at) = Endpoints::read(&dir) {
                break at;
            }
            assert!(child.try_wait().unwrap().is_none(), "serve has ended");
            assert!(Instant::now() < deadline, "serve is not ready");
            thread::sleep(Duration::from_millis(5));
        };
        Self {
            child,
            at,
            dir,
            _base: base,
        }
    }

    fn held(&self) -> Held {
        let proc = Path::new("/proc").join(self.child.id().to_string());
        let status = fs::read_to_string(proc.join("status")).unwrap();
        let number = |name: &str| -> u64 {
            let line = status.lines().find(|line| line.starts_with(name)).unwrap();
            line.split_whitespace().nth(1).unwrap().parse().unwrap()
        };
        Held {
            memory_kb: number("VmRSS:"),
            descriptors: fs::read_dir(proc.join("fd")).unwrap().count(),
            threads: number("Threads:") as usize,
            files: fs::read_dir(&self.dir).unwrap().count(),
        }
    }

    /// Returns the resources that the device holds after all clients have disconnected.
    fn held_at_rest(&self, like: Option<&Held>) -> Held {
        let deadline = Instant::now() + Duration::from_secs(10);
        loop {
            thread::sleep(Duration::from_millis(50));
            let held = self.held();
            let same = like.is_none_or(|like| {
                (held.descriptors, held.threads) == (like.descriptors, like.threads)
            });
            if (same && like.is_some()) || Instant::now() > deadline || like.is_none() {
                return held;
            }
        }
    }

    fn control(&self) -> File {
        let mut options = File::options();
        options
            .read(true)
            .write(true)
            .open(&self.at.control)
            .unwrap()
    }

    fn camera(&self) -> UnixStream {
        UnixStream::connect(self.at.camera_socket.strip_prefix("socket:").unwrap()).unwrap()
    }

    /// Sends `count` triggers, and receives a frame for each.
    fn trigger(&self, count: u64) {
        let port = SerialPort::open(self.at.control.to_str().unwrap()).unwrap();
        // The previous client may have disconnected in the middle of a line.
        let mut control = Instrument::open(port, PATIENCE).unwrap();
        control.order("ABOR;:TRIG:SOUR BUS;MODE SEQ").unwrap();
        assert_eq!(control.query("*OPC?").unwrap(), "1");
        let camera = self.camera();
        // The camera connection is registered once another command has been answered.
        assert!(control.query("*IDN?").unwrap().contains("Phasmid"));
        let read = Arc::new(AtomicU64::new(0));
        let counted = read.clone();
        let reader = thread::spawn(move || frames(camera, count, &counted));
        let batch = "INIT;*TRG;*WAI;:".repeat(BATCH as usize);
        let line = format!("{}*OPC?", batch.trim_end_matches(':'));
        for batch in 1..=count / BATCH {
            assert_eq!(control.query(&line).unwrap(), "1");
            // Wait for the reader, since a reader that falls behind by more than the queue's length
            // loses frames.
            let deadline = Instant::now() + PATIENCE;
            while read.load(Ordering::Relaxed) < batch * BATCH && Instant::now() < deadline {
                thread::yield_now();
            }
        }
        control.check("the triggers").unwrap();
        let ids = reader.join().unwrap();
        assert!(ids.windows(2).all(|pair| pair[1] == pair[0] + 1));
        control.order("TRIG:SOUR INT").unwrap();
    }

    /// Connects `count` clients, one after the other, of all kinds and behaviours.
    fn connect(&self, count: u64) {
        for client in 0..count {
            match client % 5 {
                0 => drop(self.camera()),
                1 => {
                    let ids = frames(self.camera(), 1, &AtomicU64::new(0));
                    assert_eq!(ids.len(), 1);
                }
                2 => {
                    let mut control = self.control();
                    control.write_all(b"*IDN?\n").unwrap();
                    let mut reply = String::new();
                    BufReader::new(control).read_line(&mut reply).unwrap();
                    assert!(reply.ends_with('\n'), "{reply:?}");
                }
                // This client disconnects in the middle of a command.
                3 => self.control().write_all(b"SEQ:LIST?;:*IDN").unwrap(),
                _ => {
                    let mut service = UnixStream::connect(&self.at.service).unwrap();
                    service.write_all(b"{\"get\":\"moon\"}\n").unwrap();
                    let mut reply = String::new();
                    BufReader::new(service).read_line(&mut reply).unwrap();
                    assert!(reply.contains("error"), "{reply:?}");
                }
            }
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Returns a profile of a scanner of 16 x 8 pixels whose sequence is one white frame.
fn tiny() -> Profile {
    let mut profile = Profile::load("webcam-grey").unwrap();
    profile.camera.width_px = 16;
    profile.camera.height_px = 8;
    profile.calibration = Default::default();
    profile.sequence.truncate(1);
    profile.sequence[0].frame = vec![ManifestFrame {
        file: None,
        pattern: Pattern::White {},
    }];
    profile
}

/// Returns the ids of `count` frames; counts the frames in `read` as they arrive.
fn frames(mut camera: UnixStream, count: u64, read: &AtomicU64) -> Vec<u64> {
    camera.set_read_timeout(Some(PATIENCE)).unwrap();
    let mut decoder = FrameDecoder::default();
    let mut ids = Vec::new();
    while (ids.len() as u64) < count {
        let len = camera.read(decoder.space()).unwrap();
        assert!(len > 0, "closed after {} of {count} frames", ids.len());
        ids.extend(decoder.advance(len).unwrap().map(|frame| frame.id));
        read.store(ids.len() as u64, Ordering::Relaxed);
    }
    ids
}

fn soak(triggers: u64, clients: u64) {
    let device = Device::start();
    device.trigger(triggers / 100);
    device.connect(clients / 100);
    let before = device.held_at_rest(None);
    let begin = Instant::now();
    device.trigger(triggers);
    let triggered = begin.elapsed();
    device.connect(clients);
    let connected = begin.elapsed() - triggered;
    let after = device.held_at_rest(Some(&before));
    println!("{triggers} triggers in {triggered:.1?}, {clients} clients in {connected:.1?}");
    println!("before {before:?}\nafter  {after:?}");
    let memory_kb = after.memory_kb.max(before.memory_kb);
    assert_eq!(
        Held { memory_kb, ..after },
        Held {
            memory_kb,
            ..before
        }
    );
    assert!(after.memory_kb <= before.memory_kb + GROWTH_KB);
}

#[test]
fn survives_ten_thousand_triggers_and_a_thousand_clients() {
    soak(10_000, 1000);
}

#[test]
#[ignore = "minutes"]
fn survives_a_million_triggers_and_a_hundred_thousand_clients() {
    soak(1_000_000, 100_000);
}
