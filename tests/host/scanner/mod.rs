//! The scanner with an in-memory device: a scan without faults, and scans in which frames or replies
//! are wrong in every possible way.

mod unplugged;

use phasmid::decode::Capture;
use phasmid::emulator::{Device, FrameSink};
use phasmid::error::Error;
use phasmid::geometry::{NoiseModel, Rig};
use phasmid::host::{Camera, MemoryCamera, MemoryPort, Progress, ScanOptions, Scanner};
use phasmid::profile::{Profile, Scene};
use phasmid::protocol::Frame;
use std::sync::Arc;
use std::time::Duration;

const SHORT: Duration = Duration::from_millis(20);

/// Fault of the frame that shows pattern 4.
#[derive(Clone, Copy, Debug)]
enum Fault {
    None,
    Dropped,
    Repeated,
    Foreign,
    Stray,
    WrongSize,
    /// Frame ids start at pattern 0 so that pattern 4 has the largest possible id.
    LastId,
    Damaged,
}

/// A camera that reports the frame of pattern 4 as damaged in the first runs.
struct Receiver {
    camera: MemoryCamera,
    bad_runs: u32,
    skipped: bool,
}

impl Camera for Receiver {
    fn info(&self) -> &str {
        self.camera.info()
    }

    fn next_frame(&mut self, timeout: Duration) -> Result<Option<Frame>, Error> {
        let frame = self.camera.next_frame(timeout)?;
        self.skipped =
            self.bad_runs > 0 && frame.as_ref().is_some_and(|f| f.pattern_index == Some(4));
        if self.skipped {
            self.bad_runs -= 1;
            return Err(Error::device("frame 4: its payload is damaged"));
        }
        Ok(frame)
    }

    fn has_skipped(&self) -> bool {
        self.skipped
    }
}

/// The link from the device to the camera, which has a fault in the first runs.
struct Way {
    camera: MemoryCamera,
    fault: Fault,
    bad_runs: u32,
}

impl FrameSink for Way {
    fn attended(&self) -> bool {
        true
    }

    fn put(&mut self, frame: Arc<Frame>) {
        let mut frame = (*frame).clone();
        if matches!(self.fault, Fault::LastId) && self.bad_runs > 0 {
            // Pattern 4 has id 2^64 - 1.
            frame.id = frame.id.wrapping_sub(5);
        }
        if frame.pattern_index != Some(4) || self.bad_runs == 0 {
            self.camera.put(frame);
            return;
        }
        self.bad_runs -= 1;
        match self.fault {
            Fault::None | Fault::LastId | Fault::Damaged => self.camera.put(frame),
            Fault::Dropped => {}
            Fault::Repeated => {
                self.camera.put(frame.clone());
                self.camera.put(frame);
            }
            Fault::Foreign => {
                self.camera.put(Frame {
                    pattern_index: None,
                    id: 1_000_000,
                    ..frame.clone()
                });
                self.camera.put(frame);
            }
            Fault::Stray => self.camera.put(Frame {
                id: frame.id + 77,
                ..frame
            }),
            Fault::WrongSize => self.camera.put(Frame {
                height: frame.height / 2,
                data: frame.data[..frame.data.len() / 2].to_vec(),
                ..frame
            }),
        }
    }
}

fn options() -> ScanOptions {
    ScanOptions {
        sequence: Some("quick-4".into()),
        manifest: None,
        frame_timeout: SHORT,
    }
}

fn scan(
    fault: Fault,
    bad_runs: u32,
    options: &ScanOptions,
) -> (Result<Capture, Error>, Vec<String>) {
    scan_with(None, fault, bad_runs, options)
}

/// Same as [`scan`], with a calibration that replaces the device's own.
fn scan_with(
    given: Option<Rig>,
    fault: Fault,
    bad_runs: u32,
    options: &ScanOptions,
) -> (Result<Capture, Error>, Vec<String>) {
    let profile = Profile::load("webcam-grey").unwrap();
    let camera = MemoryCamera::default();
    let mut bench = Device::builder(&profile, &Scene::load("plane").unwrap())
        .seed(1)
        .build()
        .unwrap()
        .bench(Way {
            camera: camera.clone(),
            fault,
            bad_runs,
        });
    let port = MemoryPort::new(move |bytes: &[u8]| bench.control(bytes));
    let receiver = Receiver {
        camera,
        bad_runs: if matches!(fault, Fault::Damaged) {
            bad_runs
        } else {
            0
        },
        skipped: false,
    };
    let mut scanner = Scanner::new(port, SHORT, || Ok(receiver)).unwrap();
    if let Some(rig) = given {
        scanner = scanner.with_calibration("given", rig);
    }
    let mut retries = Vec::new();
    let captured = scanner.scan(options, &mut |progress| {
        if let Progress::Retry(why) = progress {
            retries.push(why.to_owned());
        }
    });
    (captured, retries)
}

#[test]
fn a_scan_has_every_frame_in_order() {
    let profile = Profile::load("webcam-grey").unwrap();
    let (captured, retries) = scan(Fault::None, 0, &options());
    let captured = captured.unwrap();
    assert_eq!(retries, [""; 0]);
    assert_eq!(captured.idn, "Phasmid,webcam-grey,0001,0.1.0");
    assert_eq!(captured.manifest, profile.manifest(&profile.sequence[0]));
    assert_eq!(captured.calibration, Some(profile.factory_rig().unwrap()));
    let ids: Vec<_> = captured
        .frames
        .iter()
        .map(|f| (f.id, f.pattern_index))
        .collect();
    assert_eq!(
        ids,
        (0..13).map(|i| (i, Some(i as u32))).collect::<Vec<_>>()
    );
}

#[test]
fn a_calibration_without_noise_leaves_the_device_s() {
    let own = Profile::load("webcam-grey").unwrap().nominal_rig();
    let mut given = own;
    given.projector.rig_from_view.translation_mm.x += 1.0;
    for noise in [
        None,
        own.noise.map(|n| NoiseModel {
            read_noise_dn: 9.0,
            ..n
        }),
    ] {
        let rig = Rig { noise, ..given };
        let (captured, _) = scan_with(Some(rig), Fault::None, 0, &options());
        let wanted = Rig {
            noise: noise.or(own.noise),
            ..given
        };
        assert_eq!(captured.unwrap().calibration, Some(wanted));
    }
}

#[test]
fn a_fault_is_named_and_the_run_repeated_once() {
    for (fault, needle) in [
        (
            Fault::Dropped,
            "pattern 4 is missing: frame 5 with pattern 5",
        ),
        (
            Fault::Repeated,
            "frame 4 is repeated where pattern 5 was due",
        ),
        (
            Fault::Foreign,
            "frame 1000000 is foreign: it shows no pattern",
        ),
        (Fault::Stray, "frame 81 with pattern 4 is foreign"),
        (Fault::Damaged, "frame 4: its payload is damaged"),
        (Fault::WrongSize, "frame 4 is foreign: 640 x 240 pixels"),
        (
            Fault::LastId,
            "frame 5 is foreign: the frame ids overflow before it",
        ),
    ] {
        let (captured, retries) = scan(fault, 1, &options());
        assert_eq!(captured.unwrap().frames.len(), 13, "{fault:?}");
        let [why] = &retries[..] else {
            panic!("{fault:?}: {retries:?}")
        };
        assert!(why.contains(needle), "{needle} not in: {why}");

        let (captured, _) = scan(fault, 2, &options());
        let error = captured.unwrap_err();
        assert_eq!(error.exit_code(), 1);
        let message = error.to_string();
        assert!(message.contains("two runs failed"), "{message}");
    }
}

#[test]
fn a_missing_last_frame_is_a_timeout_that_says_how_long() {
    let options = ScanOptions {
        manifest: Some({
            let profile = Profile::load("webcam-grey").unwrap();
            let mut manifest = profile.manifest(&profile.sequence[0]);
            manifest.frame.push(manifest.frame[0].clone());
            manifest
        }),
        ..options()
    };
    let (captured, retries) = scan(Fault::None, 0, &options);
    let message = captured.unwrap_err().to_string();
    let needle = "pattern 13 of 14 is missing: no frame within 0.02 s";
    assert!(message.contains(needle), "{message}");
    assert_eq!(retries.len(), 1);
}

#[test]
fn more_frames_than_memory_holds_are_refused_at_once() {
    let mut profile = Profile::load("webcam-grey").unwrap();
    (profile.camera.width_px, profile.camera.height_px) = (1280, 960);
    let mut manifest = profile.manifest(&profile.sequence[0]);
    manifest.frame = vec![manifest.frame[0].clone(); 4096];
    let options = ScanOptions {
        sequence: None,
        manifest: Some(manifest),
        frame_timeout: SHORT,
    };
    for calibrated in [true, false] {
        let camera = MemoryCamera::default();
        let mut bench = Device::builder(&profile, &Scene::load("plane").unwrap())
            .seed(1)
            .build()
            .unwrap()
            .bench(Way {
                camera: camera.clone(),
                fault: Fault::None,
                bad_runs: 0,
            });
        let port = MemoryPort::new(move |bytes: &[u8]| {
            let text = String::from_utf8_lossy(bytes);
            match calibrated {
                true => bench.control(bytes),
                false => bench.control(text.replace("CAL:DATA?", "NONE?").as_bytes()),
            }
        });
        let mut scanner = Scanner::new(port, SHORT, || Ok(camera)).unwrap();
        let result = scanner.scan(&options, &mut |progress| {
            assert!(!matches!(progress, Progress::Frame { .. }), "{progress:?}");
        });
        let error = result.unwrap_err();
        assert_eq!(error.exit_code(), 1);
        let message = error.to_string();
        assert!(message.contains("4096 frames of "), "{message}");
        assert!(message.contains("at most 4096 MiB"), "{message}");
        let exposed = scanner.instrument().unwrap().query("DIAG:FRAM?").unwrap() != "0";
        assert_eq!(exposed, !calibrated, "refused before INIT when it can be");
    }
}

#[test]
fn a_sequence_that_is_not_there_is_refused_with_those_that_are() {
    let options = ScanOptions {
        sequence: Some("moon".into()),
        ..options()
    };
    let error = scan(Fault::None, 0, &options).0.unwrap_err();
    assert_eq!(error.exit_code(), 2);
    let message = error.to_string();
    assert!(message.starts_with("--sequence moon: "), "{message}");
    assert!(
        message.ends_with("expected quick-4, quick-4-xy"),
        "{message}"
    );
}

#[test]
fn port_without_a_scpi_device_is_reported() {
    let mark = "*ESE 85;*ESE?;*ESE 0;*ESE?\n";
    for (greets, answer, needle) in [
        (false, &b""[..], "no answer to *ESE? within 0.02 s"),
        (
            false,
            b"login: \n",
            "login: \\n\"): is it a SCPI instrument?",
        ),
        (true, b"", "no answer to TRIG:SOUR? within 0.02 s"),
        (
            true,
            b"\xff\xfe\n",
            "received something else: \"\\xff\\xfe\"",
        ),
        (
            true,
            b"0,\"No error\"\n",
            "TRIG:SOUR? was answered with \"0,\\\"No error\\\"\", which is not an answer to it",
        ),
    ] {
        let port = MemoryPort::new(move |bytes: &[u8]| {
            let text = String::from_utf8_lossy(bytes);
            if greets && bytes.ends_with(mark.as_bytes()) {
                return b"85;0\n".to_vec();
            }
            let Some((number, _)) = text.trim().split_once(";*ESE?;") else {
                return Vec::new();
            };
            match answer {
                // The number in the query is valid.
                [b'0', ..] => {
                    let number = number.trim_start_matches("*ESE ");
                    [number.as_bytes(), b";", answer].concat()
                }
                _ => answer.to_vec(),
            }
        });
        let result = Scanner::new(port, SHORT, || Ok(MemoryCamera::default()))
            .and_then(|mut scanner| scanner.scan(&options(), &mut |_| {}));
        let message = result.unwrap_err().to_string();
        assert!(message.contains(needle), "{needle} not in: {message}");
    }
}
