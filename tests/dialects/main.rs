//! Whole scans over the shipped dialects, host and device in memory: the host has nothing but the
//! dialect's file, and gets what it gets over SCPI.

use phasma::emulator::faults::Faults;
use phasma::emulator::port::Port;
use phasma::emulator::{Bench, Firmware, FrameSink, Machine, Renderer, SerialLine};
use phasma::host::{Captured, MemoryCamera, MemoryPort, ScanOptions, Scanner};
use phasma::profile::{Profile, Scene};
use phasma::protocol::Frame;
use phasma::protocol::dialect::Dialect;
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

/// A scan, and the device time that it took.
fn scan(dialect: &str, baud: Option<u32>) -> (Captured, u64) {
    let mut profile = Profile::load("webcam-grey").unwrap();
    (profile.camera.width_px, profile.camera.height_px) = (64, 48);
    profile.control.baud = baud;
    let dialect = Dialect::load(dialect).unwrap();
    let machine = Machine::new(
        Firmware::new(&profile, &[]).unwrap(),
        Port::new(Arc::new(dialect.clone())).unwrap(),
        SerialLine::new(&profile.control),
        Faults::default(),
    );
    let camera = MemoryCamera::default();
    let renderer = Renderer::new(&profile, &Scene::load("plane").unwrap(), 1).unwrap();
    let bench = Bench::of(machine, renderer, Sink(camera.clone()));
    let bench = Arc::new(Mutex::new(bench));
    let device = bench.clone();
    let port = MemoryPort::new(move |bytes: &[u8]| device.lock().unwrap().control(bytes));
    let spoken = (!dialect.is_scpi()).then_some(dialect);
    let timeout = Duration::from_millis(20);
    let mut scanner = Scanner::with_dialect(port, spoken, timeout, || Ok(camera)).unwrap();
    let options = ScanOptions {
        sequence: None,
        manifest: None,
        frame_timeout: timeout,
    };
    let captured = scanner.scan(&options, &mut |_| {}).unwrap();
    scanner.finish().unwrap();
    let now_ns = bench.lock().unwrap().now_ns();
    (captured, now_ns)
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
            assert!(frame.data == expected.data, "{dialect}: other pixels");
        }
    }
}

#[test]
fn a_slow_line_takes_its_time_and_changes_nothing() {
    for dialect in ["scpi", "okline", "dlpc350"] {
        let (fast, fast_ns) = scan(dialect, None);
        let (slow, slow_ns) = scan(dialect, Some(115_200));
        assert!(
            fast.frames
                .iter()
                .zip(&slow.frames)
                .all(|(a, b)| a.data == b.data)
        );
        // The manifest alone has well over a thousand bytes.
        assert!(
            slow_ns > fast_ns + 100_000_000,
            "{dialect}: {fast_ns} {slow_ns}"
        );
    }
}
