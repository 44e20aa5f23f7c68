//! Faults on the control port: whatever happens to one message or its reply, a scan returns the
//! same frames, manifest and calibration as without faults, or reports what is wrong.

use phasmid::decode::Capture;
use phasmid::emulator::{Bench, Device, FrameSink};
use phasmid::error::Error;
use phasmid::host::{Camera, CommandPort, MemoryCamera, Progress, ScanOptions, Scanner};
use phasmid::pattern::Image;
use phasmid::profile::{Profile, Scene};
use phasmid::protocol::Frame;
use phasmid::protocol::dialect::Dialect;
use std::collections::VecDeque;
use std::io::Read;
use std::sync::Arc;
use std::time::Duration;

const SHORT: Duration = Duration::from_millis(5);
/// Number of messages of a scan; the last messages come after its frames.
const MESSAGES: u32 = 20;

#[derive(Clone, Copy, Debug)]
enum Fault {
    None,
    /// The reply is lost.
    Lost,
    /// The reply comes together with the next reply.
    Late,
    Twice,
    GarbageBefore,
    GarbageInside,
    /// The bit of the reply with this index is flipped.
    Reply(usize),
    /// The bit of the message with this index is flipped.
    Message(usize),
    /// In the reply, the bit is flipped that turns the name of one sequence into that of the other.
    OtherInReply,
    /// In the message, the same bit is flipped.
    OtherInMessage,
    /// The cable is pulled before the message, and the port has to be reopened.
    Gone,
    /// The device is power-cycled before the message.
    Reset,
    /// The device is power-cycled after the message, when half of its frames have arrived.
    ResetAfter,
}

/// The sequence that the scans select.
const OTHER: &str = "quick-5";

struct Sink(MemoryCamera);

impl FrameSink for Sink {
    fn attended(&self) -> bool {
        true
    }

    fn put(&mut self, frame: Arc<Frame>) {
        self.0.put((*frame).clone());
    }
}

fn profile() -> Profile {
    let mut profile = Profile::load("webcam-grey").unwrap();
    (profile.camera.width_px, profile.camera.height_px) = (64, 48);
    // Names that differ in one bit.
    assert_eq!(profile.sequence[0].name, "quick-4");
    profile.sequence[1].name = OTHER.into();
    profile
}

/// Flips the bit that turns `quick-4` into `quick-5`, or back, in the first such name.
fn rename(bytes: &mut [u8]) {
    let is_name = |word: &[u8]| word.starts_with(b"quick-") && matches!(word[6], b'4' | b'5');
    if let Some(at) = bytes.windows(7).position(is_name) {
        bytes[at + 6] ^= 1;
    }
}

fn bench(dialect: &Dialect, camera: &MemoryCamera) -> Bench<Sink> {
    let profile = profile();
    let scene = Scene::load("plane").unwrap();
    let device = Device::builder(&profile, &scene).seed(1);
    let device = device.dialect(dialect.clone()).build().unwrap();
    device.bench(Sink(camera.clone()))
}

/// A port on which one message meets a fault.
struct Port {
    dialect: Dialect,
    bench: Bench<Sink>,
    camera: MemoryCamera,
    fault: Fault,
    nth: u32,
    count: u32,
    gone: bool,
    late: Vec<u8>,
    replies: VecDeque<u8>,
}

impl Port {
    fn reset(&mut self) {
        self.bench = bench(&self.dialect, &self.camera);
        self.replies.clear();
    }

    /// Drops all waiting frames except the first `frames`.
    fn keep(&mut self, frames: usize) {
        let mut kept = Vec::new();
        while let Some(frame) = self.camera.next_frame(Duration::ZERO).unwrap() {
            kept.push(frame);
        }
        kept.truncate(frames);
        kept.into_iter().for_each(|frame| self.camera.put(frame));
    }
}

impl CommandPort for Port {
    fn info(&self) -> &str {
        "bad line"
    }

    fn send(&mut self, bytes: &[u8], _timeout: Duration) -> Result<(), Error> {
        self.count += 1;
        let now = self.count == self.nth;
        let mut bytes = bytes.to_vec();
        match self.fault {
            Fault::Gone if now => self.gone = true,
            Fault::Reset if now => self.reset(),
            Fault::Message(bit) if now => {
                if let Some(byte) = bytes.get_mut(bit / 8) {
                    *byte ^= 1 << (bit % 8);
                }
            }
            Fault::OtherInMessage if now => rename(&mut bytes),
            _ => {}
        }
        if self.gone {
            return Err(Error::device("bad line: the device disconnected"));
        }
        let mut reply = self.bench.control(&bytes);
        let late = std::mem::take(&mut self.late);
        match self.fault {
            _ if !now => {}
            Fault::Lost => reply.clear(),
            Fault::Late => self.late = std::mem::take(&mut reply),
            Fault::Twice => reply = [reply.clone(), reply].concat(),
            Fault::GarbageBefore => reply = [&b"\xfe#3\x00;9"[..], &reply].concat(),
            Fault::GarbageInside => {
                let half = reply.len() / 2;
                reply.splice(half..half, *b"\x80\x07~");
            }
            Fault::Reply(bit) => {
                if let Some(byte) = reply.get_mut(bit / 8) {
                    *byte ^= 1 << (bit % 8);
                }
            }
            Fault::OtherInReply => rename(&mut reply),
            Fault::ResetAfter => {
                self.keep(6);
                self.reset();
            }
            _ => {}
        }
        self.replies.extend(late);
        self.replies.extend(reply);
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], _timeout: Duration) -> Result<usize, Error> {
        if self.gone {
            return Err(Error::device("bad line: the device disconnected"));
        }
        self.replies
            .read(buffer)
            .map_err(|e| Error::io("bad line", e))
    }

    fn reopen(&mut self, _timeout: Duration) -> Result<(), Error> {
        self.gone = false;
        self.bench.device_mut().machine.hang_up();
        self.replies.clear();
        Ok(())
    }
}

fn scan(fault: Fault, nth: u32) -> (Result<Capture, Error>, Vec<String>) {
    scan_in(&Dialect::load("scpi").unwrap(), fault, nth)
}

/// Same as [`scan`] in a dialect.
fn scan_in(dialect: &Dialect, fault: Fault, nth: u32) -> (Result<Capture, Error>, Vec<String>) {
    scan_of(dialect, Some(OTHER), fault, nth)
}

/// Same as [`scan_in`] for the given sequence, or for the present one if `None`.
fn scan_of(
    dialect: &Dialect,
    sequence: Option<&str>,
    fault: Fault,
    nth: u32,
) -> (Result<Capture, Error>, Vec<String>) {
    let camera = MemoryCamera::default();
    let port = Port {
        dialect: dialect.clone(),
        bench: bench(dialect, &camera),
        camera: camera.clone(),
        fault,
        nth,
        count: 0,
        gone: false,
        late: Vec::new(),
        replies: VecDeque::new(),
    };
    let options = ScanOptions {
        sequence: sequence.map(str::to_owned),
        manifest: None,
        frame_timeout: SHORT,
    };
    let mut retries = Vec::new();
    let scanner = Scanner::with_dialect(port, Some(dialect.clone()), SHORT, || Ok(camera));
    let captured = scanner.and_then(|mut scanner| {
        let captured = scanner.scan(&options, &mut |progress| {
            if let Progress::Retry(why) = progress {
                retries.push(why.to_owned());
            }
        });
        scanner.finish().and(captured)
    });
    (captured, retries)
}

/// Returns whether two captures are equal except for noise, which differs from run to run.
fn same(one: &Capture, other: &Capture) -> bool {
    let alike = |(a, b): (&Image, &Image)| {
        let [a, b] = [a, b].map(|image| image.as_u8().unwrap());
        let differences = a.iter().zip(b).map(|(a, b)| a.abs_diff(*b));
        let sum: u32 = differences.map(u32::from).sum();
        a.len() == b.len() && sum < 2 * a.len() as u32
    };
    let shown =
        |capture: &Capture| -> Vec<_> { capture.frames.iter().map(|f| f.pattern_index).collect() };
    one.idn == other.idn
        && one.manifest == other.manifest
        && one.calibration == other.calibration
        && shown(one) == shown(other)
        && one.images.len() == other.images.len()
        && one.images.iter().zip(&other.images).all(alike)
}

/// Scans with a fault at each message in turn; all scans must give the result of a scan without
/// faults.
fn recovered(fault: Fault) -> Vec<String> {
    let good = scan(Fault::None, 0).0.unwrap();
    let mut retries = Vec::new();
    for nth in 1..=MESSAGES {
        let (captured, why) = scan(fault, nth);
        let captured = captured.unwrap_or_else(|e| panic!("{fault:?} at {nth}: {e}"));
        assert!(same(&captured, &good), "{fault:?} at {nth}: {why:?}");
        retries.extend(why.into_iter().map(|why| format!("at {nth}: {why}")));
    }
    retries
}

#[test]
fn lost_late_and_doubled_replies_cost_no_run() {
    for fault in [Fault::None, Fault::Twice, Fault::Late, Fault::Lost] {
        assert_eq!(recovered(fault), [""; 0], "{fault:?}");
    }
}

#[test]
fn garbage_costs_no_run() {
    for fault in [Fault::GarbageBefore, Fault::GarbageInside] {
        assert_eq!(recovered(fault), [""; 0], "{fault:?}");
    }
}

#[test]
fn a_cable_that_is_pulled_and_put_back_costs_a_run_at_most() {
    assert!(recovered(Fault::Gone).len() <= MESSAGES as usize);
}

#[test]
fn a_device_that_is_reset_is_set_up_anew() {
    assert!(!recovered(Fault::Reset).is_empty());
    assert!(!recovered(Fault::ResetAfter).is_empty());
}

/// Flips a few bits of each message and each reply, and never gets a wrong cloud; the host's unit
/// tests flip all bits.
#[test]
fn flipped_bits_never_give_another_cloud() {
    let good = scan(Fault::None, 0).0.unwrap();
    let mut reported = Vec::new();
    for bit in (3..300).step_by(53) {
        for nth in 1..=MESSAGES {
            for fault in [Fault::Reply(bit), Fault::Message(bit)] {
                let (captured, why) = scan(fault, nth);
                match captured {
                    Ok(captured) => {
                        assert!(same(&captured, &good), "{fault:?} at {nth}: {why:?}");
                    }
                    Err(error) => reported.push(format!("{fault:?} at {nth}: {error}")),
                }
            }
        }
    }
    // A single flipped bit is corrected if it is detectable.
    assert_eq!(reported, [""; 0]);
}

/// The same scan gives the same result in every dialect, which only a file describes. With a fault
/// at some message, the scan gives the same result or an error.
#[test]
fn dialects_scan_as_scpi_does() {
    let good = scan(Fault::None, 0).0.unwrap();
    for name in ["okline", "dlpc350"] {
        let dialect = Dialect::load(name).unwrap();
        let (captured, retries) = scan_in(&dialect, Fault::None, 0);
        let captured = captured.unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(same(&captured, &good), "{name}");
        assert_eq!(retries, [""; 0], "{name}");
        let faults = [
            Fault::Lost,
            Fault::Twice,
            Fault::GarbageBefore,
            Fault::Reply(21),
            Fault::Message(33),
            Fault::Gone,
            Fault::Reset,
            Fault::ResetAfter,
        ];
        for fault in faults {
            for nth in (1..60).step_by(7) {
                if let (Ok(captured), why) = scan_in(&dialect, fault, nth) {
                    assert!(same(&captured, &good), "{name} {fault:?} at {nth}: {why:?}");
                }
            }
        }
    }
}

/// The names of the two sequences differ in one bit. Flipping this bit never changes which sequence
/// is scanned, and never aborts a scan.
#[test]
fn damaged_sequence_name_does_not_select_another() {
    for name in ["scpi", "okline", "dlpc350"] {
        let dialect = Dialect::load(name).unwrap();
        for sequence in [None, Some("quick-4"), Some(OTHER)] {
            let good = scan_of(&dialect, sequence, Fault::None, 0).0.unwrap();
            let frames = if sequence == Some(OTHER) { 23 } else { 13 };
            assert_eq!(good.frames.len(), frames, "{name} {sequence:?}");
            for fault in [Fault::OtherInReply, Fault::OtherInMessage] {
                for nth in 1..=MESSAGES {
                    let (captured, why) = scan_of(&dialect, sequence, fault, nth);
                    let place = format!("{name} {sequence:?} {fault:?} at {nth}: {why:?}");
                    let captured = captured.unwrap_or_else(|e| panic!("{place}: {e}"));
                    assert!(same(&captured, &good), "{place}");
                }
            }
        }
    }
}
