//! A device whose cable is pulled during a scan: camera and port disappear at the same time, and
//! then come back or do not.

use super::{SHORT, options};
use phasmid::decode::Capture;
use phasmid::emulator::{Device, FrameSink};
use phasmid::error::Error;
use phasmid::host::{Camera, CommandPort, MemoryCamera, Progress, Scanner};
use phasmid::profile::{Profile, Scene};
use phasmid::protocol::Frame;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::io::Read;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

/// Event at which the cable is pulled: the host requests its nth frame, or sends its nth line.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Pulled {
    Frame(usize),
    Line(usize),
    /// Only the camera's cable is pulled, when the host requests its nth frame.
    Camera(usize),
}

/// State shared by both ends of the cable.
struct Cable {
    plugged: bool,
    pulled: Pulled,
    /// Number of times that the cable is pulled, at the same point each time, and plugged in again.
    pulls: u32,
    returns: u32,
    frames: usize,
    lines: usize,
    /// Names of the endpoints that the host has reopened, in order.
    opened: Vec<&'static str>,
    /// Frames that the host has not taken yet.
    waiting: MemoryCamera,
}

type Shared = Rc<RefCell<Cable>>;

impl Cable {
    fn pull(&mut self, now: bool) {
        if now && self.plugged && self.pulls > 0 {
            self.pulls -= 1;
            self.plugged = false;
            (self.frames, self.lines) = (0, 0);
            while let Ok(Some(_)) = self.waiting.next_frame(Duration::ZERO) {}
        }
    }

    fn plug_in(&mut self, what: &'static str) -> Result<(), Error> {
        self.opened.push(what);
        if !self.plugged && self.returns > 0 {
            self.returns -= 1;
            self.plugged = true;
        }
        match self.plugged {
            true => Ok(()),
            false => Err(Error::device("the device has not come back")),
        }
    }
}

struct Unplugged {
    cable: Shared,
    gone: bool,
}

impl Camera for Unplugged {
    fn info(&self) -> &str {
        "camera on a cable"
    }

    fn next_frame(&mut self, timeout: Duration) -> Result<Option<Frame>, Error> {
        let mut cable = self.cable.borrow_mut();
        let at = cable.frames;
        let now = [Pulled::Frame(at), Pulled::Camera(at)].contains(&cable.pulled);
        cable.pull(now);
        self.gone |= !cable.plugged;
        if self.gone {
            return Err(Error::device("camera on a cable: the device disconnected"));
        }
        let frame = cable.waiting.next_frame(timeout)?;
        cable.frames += usize::from(frame.is_some());
        Ok(frame)
    }

    fn has_gone(&self) -> bool {
        self.gone
    }

    fn reopen(&mut self, _: Duration) -> Result<(), Error> {
        self.cable.borrow_mut().plug_in("camera")?;
        self.gone = false;
        Ok(())
    }
}

struct Line<D> {
    cable: Shared,
    bench: D,
    replies: VecDeque<u8>,
    gone: bool,
}

impl<D> Line<D> {
    fn look(&mut self) -> Result<(), Error> {
        let cable = self.cable.borrow();
        self.gone |= !cable.plugged && !matches!(cable.pulled, Pulled::Camera(_));
        match self.gone {
            true => Err(Error::device("port on a cable: the device disconnected")),
            false => Ok(()),
        }
    }
}

impl<D: FnMut(&[u8]) -> Vec<u8>> CommandPort for Line<D> {
    fn info(&self) -> &str {
        "port on a cable"
    }

    fn send(&mut self, bytes: &[u8], _: Duration) -> Result<(), Error> {
        {
            let mut cable = self.cable.borrow_mut();
            let now = cable.pulled == Pulled::Line(cable.lines);
            cable.pull(now);
            cable.lines += 1;
        }
        self.look()?;
        self.replies.extend((self.bench)(bytes));
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], _: Duration) -> Result<usize, Error> {
        self.look()?;
        self.replies.read(buffer).map_err(|e| Error::io("port", e))
    }

    fn reopen(&mut self, _: Duration) -> Result<(), Error> {
        self.cable.borrow_mut().plug_in("port")?;
        self.replies.clear();
        self.gone = false;
        Ok(())
    }
}

struct Sink(MemoryCamera);

impl FrameSink for Sink {
    fn attended(&self) -> bool {
        true
    }

    fn put(&mut self, frame: Arc<Frame>) {
        self.0.put((*frame).clone());
    }
}

/// Result of a scan.
struct Outcome {
    captured: Result<Capture, Error>,
    retries: Vec<String>,
    opened: Vec<&'static str>,
    /// Whether the cable was pulled as often as planned.
    pulled: bool,
}

fn scan(pulled: Pulled, pulls: u32, returns: u32) -> Outcome {
    let mut profile = Profile::load("webcam-grey").unwrap();
    (profile.camera.width_px, profile.camera.height_px) = (64, 48);
    let waiting = MemoryCamera::default();
    let mut bench = Device::builder(&profile, &Scene::load("plane").unwrap())
        .seed(1)
        .build()
        .unwrap()
        .bench(Sink(waiting.clone()));
    let cable = Rc::new(RefCell::new(Cable {
        plugged: true,
        pulled,
        pulls: 0,
        returns,
        frames: 0,
        lines: 0,
        opened: Vec::new(),
        waiting,
    }));
    let port = Line {
        cable: cable.clone(),
        bench: move |bytes: &[u8]| bench.control(bytes),
        replies: VecDeque::new(),
        gone: false,
    };
    let camera = Unplugged {
        cable: cable.clone(),
        gone: false,
    };
    let mut scanner = Scanner::new(port, SHORT, || Ok(camera)).unwrap();
    {
        let mut cable = cable.borrow_mut();
        (cable.pulls, cable.frames, cable.lines) = (pulls, 0, 0);
    }
    let mut retries = Vec::new();
    let captured = scanner.scan(&options(), &mut |progress| {
        if let Progress::Retry(why) = progress {
            retries.push(why.to_owned());
        }
    });
    let opened = cable.borrow().opened.clone();
    let finished = scanner.finish();
    if captured.is_err() && returns == 0 {
        // The scan has already waited for the device in vain, so finishing must not reopen anything.
        assert_eq!(cable.borrow().opened, opened, "{pulled:?}");
    }
    let captured = captured.and_then(|captured| finished.map(|()| captured));
    let pulled = cable.borrow().pulls == 0;
    Outcome {
        captured,
        retries,
        opened,
        pulled,
    }
}

fn indices(captured: &Capture) -> Vec<Option<u32>> {
    captured.frames.iter().map(|f| f.pattern_index).collect()
}

#[test]
fn unplugged_at_any_frame_and_back_in_time_the_scan_is_whole() {
    let all: Vec<_> = (0..13).map(Some).collect();
    for at in 0..13 {
        let outcome = scan(Pulled::Frame(at), 1, 1);
        assert!(outcome.pulled, "{at}");
        assert_eq!(indices(&outcome.captured.unwrap()), all, "{at}");
        assert_eq!(
            outcome.retries,
            ["camera on a cable: the device disconnected"]
        );
        // The device is stopped before its camera is opened.
        assert_eq!(outcome.opened, ["port", "camera"], "{at}");
    }
}

#[test]
fn unplugged_at_any_line_and_back_in_time_the_scan_is_whole() {
    let all: Vec<_> = (0..13).map(Some).collect();
    let mut lines = 0;
    loop {
        let outcome = scan(Pulled::Line(lines), 1, 1);
        assert_eq!(indices(&outcome.captured.unwrap()), all, "{lines}");
        if !outcome.pulled {
            break;
        }
        lines += 1;
    }
    // A scan needs lines for identification, commands, settings, two documents that are each read
    // twice, and arming.
    assert!(lines > 10, "{lines}");
}

#[test]
fn unplugged_camera_reopens_only_the_camera() {
    let outcome = scan(Pulled::Camera(4), 1, 1);
    assert_eq!(outcome.captured.unwrap().frames.len(), 13);
    assert_eq!(outcome.opened, ["camera"]);
}

#[test]
fn device_that_stays_unplugged_fails_once_in_one_line() {
    for (pulled, opened) in [
        (Pulled::Frame(4), "port"),
        (Pulled::Line(4), "port"),
        (Pulled::Camera(4), "camera"),
    ] {
        let outcome = scan(pulled, 1, 0);
        let error = outcome.captured.unwrap_err();
        assert_eq!(error.exit_code(), 1, "{pulled:?}");
        let words = error.to_string();
        assert!(
            words.contains(" on a cable: the device disconnected; then: "),
            "{words}"
        );
        assert!(words.ends_with("the device has not come back"), "{words}");
        assert!(!words.contains('\n'), "{words}");
        assert_eq!(outcome.opened, [opened], "{pulled:?}");
        assert_eq!(outcome.retries, [""; 0], "{pulled:?}");
    }
}

#[test]
fn repeated_unplugging_ends_the_scan() {
    assert!(scan(Pulled::Frame(4), 2, 9).captured.is_ok());
    let outcome = scan(Pulled::Frame(4), 3, 9);
    let words = outcome.captured.unwrap_err().to_string();
    assert_eq!(words, "camera on a cable: the device disconnected");
    assert_eq!(outcome.retries.len(), 2);
}
