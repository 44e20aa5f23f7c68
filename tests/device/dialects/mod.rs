//! Whole scans in the shipped dialects, with host and device in memory: the host knows only the file
//! of the dialect, and gets the same result as over SCPI.

mod scpi_files;

use phasmid::decode::Capture;
use phasmid::emulator::{Device, FrameSink};
use phasmid::host::{MemoryCamera, MemoryPort, Progress, ScanOptions, Scanner};
use phasmid::pattern::Manifest;
use phasmid::profile::{Profile, Scene};
use phasmid::protocol::Frame;
use phasmid::protocol::dialect::Dialect;
use std::sync::{Arc, Mutex};
use std::time::Duration;

struct Sink(MemoryCamera);

impl FrameSink for Sink {
    fn attended(&self) -> bool {
        true
    }

    fn put(&mut self, frame: Arc<Frame>) {
        self.0.put((*frame).clone());
    }
}

/// Scans in a shipped dialect; returns the capture and the device time in nanoseconds that it took.
fn scan(dialect: &str, baud: Option<u32>) -> (Capture, u64) {
    let scanned = scan_in(Dialect::load(dialect).unwrap(), baud, None);
    let (captured, now_ns, retries) = scanned.unwrap();
    assert_eq!(retries, [""; 0], "{dialect}");
    (captured, now_ns)
}

/// Same as [`scan`] for any dialect, with a manifest if it needs one; also returns the reasons for
/// repeated runs.
fn scan_in(
    dialect: Dialect,
    baud: Option<u32>,
    manifest: Option<Manifest>,
) -> phasmid::Result<(Capture, u64, Vec<String>)> {
    let mut profile = Profile::load("webcam-grey").unwrap();
    (profile.camera.width_px, profile.camera.height_px) = (64, 48);
    profile.control.baud = baud;
    let scene = Scene::load("plane").unwrap();
    let device = Device::builder(&profile, &scene).seed(1);
    let device = device.dialect(dialect.clone()).build().unwrap();
    let camera = MemoryCamera::default();
    let bench = Arc::new(Mutex::new(device.bench(Sink(camera.clone()))));
    let device = bench.clone();
    let port = MemoryPort::new(move |bytes: &[u8]| device.lock().unwrap().control(bytes));
    let timeout = Duration::from_millis(20);
    let mut scanner = Scanner::with_dialect(port, Some(dialect), timeout, || Ok(camera))?;
    let options = ScanOptions {
        sequence: None,
        manifest,
        frame_timeout: timeout,
    };
    let mut retries = Vec::new();
    let captured = scanner.scan(&options, &mut |progress| {
        if let Progress::Retry(why) = progress {
            retries.push(why.to_owned());
        }
    })?;
    scanner.finish()?;
    let now_ns = bench.lock().unwrap().now_ns();
    Ok((captured, now_ns, retries))
}

/// Returns the dialect file in the guide's example, copied from the guide as a reader would do.
fn gspark() -> String {
    let guide = include_str!("../../../src/protocol/dialect/guide.md");
    let (_, rest) = guide.split_once("```toml dialect\n").unwrap();
    rest.split_once("```").unwrap().0.to_owned()
}

#[test]
fn dialect_of_the_guide_gives_the_same_scan() {
    let (plain, _) = scan("scpi", None);
    let identify = "identify = { steps = [{ command = \"firmware\" }], ";
    let result = "result = \"{maker},{model},{serial},{version}\" }\n";
    let without = gspark().replace(&format!("{identify}{result}"), "");
    assert_ne!(without, gspark());
    for (text, idn) in [
        (gspark(), &plain.idn[..]),
        (without, "a device that speaks gspark"),
    ] {
        let dialect = Dialect::parse(&text, "guide.md").unwrap();
        let (captured, _, retries) = scan_in(dialect, None, Some(plain.manifest.clone())).unwrap();
        assert_eq!(retries, [""; 0]);
        assert_eq!(captured.idn, idn);
        assert_eq!(captured.frames.len(), plain.frames.len());
        for (frame, expected) in captured.frames.iter().zip(&plain.frames) {
            assert_eq!(frame.pattern_index, expected.pattern_index);
        }
        assert!(captured.images == plain.images, "other pixels");
    }
}

#[test]
fn a_dialect_without_a_trigger_is_refused_at_once() {
    let trigger = "trigger = { steps = [{ command = \"scan\" }] }\n";
    let text = gspark().replace(trigger, "");
    let dialect = Dialect::parse(&text, "mine").unwrap();
    assert!(dialect.host().needed().eq(["trigger"]));
    let port =
        MemoryPort::new(|bytes: &[u8]| panic!("the host must send nothing, but sent {bytes:?}"));
    let timeout = Duration::from_millis(20);
    let camera = || Ok(MemoryCamera::default());
    let error = Scanner::with_dialect(port, Some(dialect), timeout, camera).err();
    let error = error.unwrap();
    assert_eq!(error.exit_code(), 2, "{error}");
    let words = error.to_string();
    assert!(
        words.contains("gspark") && words.contains("no trigger"),
        "{words}"
    );
    // A dialect that cannot report a manifest needs one from a file.
    let gspark = Dialect::parse(&gspark(), "guide.md").unwrap();
    let error = scan_in(gspark, None, None).err().unwrap();
    assert_eq!(error.exit_code(), 2, "{error}");
    assert!(error.to_string().starts_with("--manifest"), "{error}");
}

#[test]
fn every_dialect_gives_the_same_scan() {
    let (plain, _) = scan("scpi", None);
    assert_eq!(plain.frames.len(), 13);
    for dialect in ["okline", "dlpc350"] {
        let (captured, _) = scan(dialect, None);
        assert_eq!(captured.idn, plain.idn, "{dialect}");
        assert_eq!(captured.manifest, plain.manifest, "{dialect}");
        assert_eq!(captured.calibration, plain.calibration, "{dialect}");
        assert_eq!(captured.frames.len(), 13, "{dialect}");
        for (frame, expected) in captured.frames.iter().zip(&plain.frames) {
            assert_eq!(frame.pattern_index, expected.pattern_index, "{dialect}");
        }
        assert!(captured.images == plain.images, "{dialect}: other pixels");
    }
}

#[test]
fn slow_line_takes_longer_and_gives_the_same_frames() {
    for dialect in ["scpi", "okline", "dlpc350"] {
        let (fast, fast_ns) = scan(dialect, None);
        let (slow, slow_ns) = scan(dialect, Some(115_200));
        assert!(fast.images == slow.images);
        // The manifest alone takes well over a thousand bytes on the line.
        assert!(
            slow_ns > fast_ns + 100_000_000,
            "{dialect}: {fast_ns} {slow_ns}"
        );
    }
}
