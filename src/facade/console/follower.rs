//! Finds the scans among the frames of a served device, shows the scans, and passes viewers' requests to
//! the device's service channel.

use super::ScanViews;
use super::calibrator::let_calibrate;
use crate::facade::ask_service;
use phasmid_console::{self as console, Operator, Sequence, Source};
use phasmid_core::error::{Error, Result};
use phasmid_decode::{Capture, FrameInfo};
use phasmid_geometry::Rig;
use phasmid_pattern::Manifest;
use phasmid_protocol::Frame;
use phasmid_protocol::record::{Event, Observer};
use phasmid_protocol::service::{Item, Request};
use serde_json::Value;
use std::fmt;
use std::mem::take;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Shows the scans of a device that is being served, whichever program performs the scans.
///
/// A follower never uses the device's control port. It needs the frames, the sequence and the
/// calibration. It requests the latter two on the service channel, so it shows scans of emulated devices
/// only.
///
/// ```
/// # #[cfg(target_os = "linux")] {
/// use phasmid::{Console, ConsoleOptions, Device, Follower, ScanOptions, Scanner, ServeOptions};
///
/// let console = Console::start(&ConsoleOptions::default())?;
/// let follower = Follower::start(console.source("bench"))?;
/// let options = ServeOptions {
///     observer: Some(follower.observer()),
///     ..ServeOptions::default()
/// };
/// let device = Device::builder().profile("webcam-grey").scene("sphere").build()?;
/// let serving = device.serve(&options)?;
/// let at = serving.endpoints();
/// follower.ask_at(&at.service);
/// Scanner::connect(&at.camera, &at.control, ScanOptions::default())?.scan()?;
/// # }
/// # Ok::<(), phasmid::Error>(())
/// ```
pub struct Follower {
    source: Source,
    inbox: Arc<Inbox>,
}

/// State of the device as seen so far.
#[derive(Default)]
struct Seen {
    /// Path of the device's service channel, once it is known.
    service: Option<PathBuf>,
    /// The current run.
    run: Run,
    /// The run before the current run; it may be complete.
    before: Run,
    /// Number of runs so far.
    runs: u64,
    /// Whether there is a change that the thread that shows the scans has not seen yet.
    news: bool,
    /// Whether the follower is to end.
    ended: bool,
}

/// Consecutive frames of a sequence, starting with its first pattern.
#[derive(Clone, Default)]
struct Run {
    /// Number of the run, counted from 1.
    number: u64,
    frames: Vec<Arc<Frame>>,
}

#[derive(Default)]
struct Inbox {
    seen: Mutex<Seen>,
    news: Condvar,
}

impl Inbox {
    fn seen(&self) -> MutexGuard<'_, Seen> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut Seen)) {
        let mut seen = self.seen();
        change(&mut seen);
        seen.news = true;
        drop(seen);
        self.news.notify_all();
    }

    /// Adds a frame to the current run if it continues that run. A frame with pattern 0 begins a run.
    fn take(&self, frame: &Arc<Frame>) {
        self.change(|seen| {
            let run = &mut seen.run.frames;
            let first = run.first();
            if first.is_some_and(|first| continues(first, run.len(), frame)) {
                run.push(frame.clone());
                return;
            }
            if !run.is_empty() {
                seen.before = std::mem::take(&mut seen.run);
            }
            if frame.pattern_index == Some(0) {
                seen.runs += 1;
                seen.run = Run {
                    number: seen.runs,
                    frames: vec![frame.clone()],
                };
            }
        });
    }
}

impl Follower {
    /// Creates a follower that shows the scans of a device as this source of a console.
    ///
    /// # Errors
    /// Returns an error if the system refuses a thread.
    pub fn start(source: Source) -> Result<Self> {
        source.restart(true);
        Self::of_host(source)
    }

    /// Starts a follower as [`Self::start`] does, for frames that a host has received, with times
    /// on the host's clock.
    pub(super) fn of_host(source: Source) -> Result<Self> {
        let inbox = Arc::new(Inbox::default());
        let_calibrate(&source);
        let (theirs, shown) = (inbox.clone(), source.clone());
        let thread = std::thread::Builder::new().name("follower".into());
        let thread = thread.spawn(move || follow(&theirs, &shown));
        thread.map_err(|e| Error::io("follower", e))?;
        Ok(Self { source, inbox })
    }

    /// Returns the observer for the device's events.
    pub fn observer(&self) -> Observer {
        let (inbox, shown) = (self.inbox.clone(), self.source.observer());
        Observer::new(move |time_ns, channel, event| {
            if let Event::Frame(frame) = event {
                inbox.take(frame);
            }
            shown.see(time_ns, channel, event);
        })
    }

    /// Sets the path of the device's service channel. Until it is set, no scan is shown. Viewers
    /// can also send requests to the channel.
    pub fn ask_at(&self, service: impl Into<PathBuf>) {
        let service = service.into();
        self.source.operate(Arc::new(ServiceOperator {
            service: service.clone(),
        }));
        self.inbox.change(|seen| seen.service = Some(service));
    }
}

impl fmt::Debug for Follower {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Follower")
    }
}

impl Drop for Follower {
    fn drop(&mut self) {
        // Do not join the thread: it may be waiting for the device.
        self.inbox.change(|seen| seen.ended = true);
    }
}

/// Returns whether a frame continues a run of `len` frames that begins with `first`.
pub(super) fn continues(first: &Frame, len: usize, frame: &Frame) -> bool {
    let len = len as u64;
    frame.pattern_index.map(u64::from) == Some(len)
        && first.id.checked_add(len) == Some(frame.id)
        && (first.width, first.height) == (frame.width, frame.height)
        && first.format == frame.format
}

/// The sequence that a device had selected in a run.
struct Selected {
    /// Number of the run.
    run: u64,
    sequence: Arc<Sequence>,
}

/// Shows each complete run, until the follower ends.
fn follow(inbox: &Inbox, source: &Source) {
    let mut selected: Option<Selected> = None;
    // Number of the last run that was shown.
    let mut shown = 0;
    loop {
        let mut seen = inbox.seen();
        while !take(&mut seen.news) && !seen.ended {
            seen = { inbox.news.wait(seen) }.unwrap_or_else(PoisonError::into_inner);
        }
        if seen.ended {
            return;
        }
        let Some(service) = seen.service.clone() else {
            continue;
        };
        let runs = [seen.before.clone(), seen.run.clone()];
        drop(seen);
        for run in runs {
            if run.number <= shown || run.frames.is_empty() {
                continue;
            }
            if selected
                .as_ref()
                .is_none_or(|known| known.run != run.number)
            {
                selected = ask(&service, run.number);
            }
            // If the device did not answer, it has ended: show nothing.
            let Some(Selected { sequence, .. }) = &selected else {
                continue;
            };
            source.show_sequence(sequence.clone());
            if run.frames.len() == sequence.manifest.frame.len() {
                shown = run.number;
                // Ignore an error: viewers of single frames see which frame cannot be unpacked.
                if let Ok(views) = views(&run.frames, sequence) {
                    source.show(Arc::new(views.with_service(&service)));
                }
            }
        }
    }
}

/// Asks the device for its selected sequence; `run` is the number of the current run.
fn ask(service: &Path, run: u64) -> Option<Selected> {
    let (reply, _) = ask_service(service, &Request::Get(Item::Sequence)).ok()?;
    let about = reply.sequence?;
    let (reply, _) = ask_service(service, &Request::Get(Item::Calibration)).ok()?;
    let rig = Rig::from_toml(&reply.calibration?, "calibration").ok()?;
    let sequence = Sequence {
        manifest: Manifest::parse(&about.manifest, &about.name).ok()?,
        name: Some(about.name),
        calibration: Some(rig),
    };
    Some(Selected {
        run,
        sequence: Arc::new(sequence),
    })
}

/// Returns the views of a complete run of a sequence.
///
/// # Errors
/// Returns an error if a frame cannot be unpacked.
pub(super) fn views(run: &[Arc<Frame>], sequence: &Sequence) -> Result<ScanViews> {
    let images = run.iter().map(|frame| Frame::clone(frame).into_image());
    let frames = run.iter().map(|frame| FrameInfo {
        id: frame.id,
        pattern_index: frame.pattern_index,
        exposure_start_ns: frame.exposure_start_ns,
        exposure_end_ns: frame.exposure_end_ns,
    });
    let views = ScanViews::new(Capture {
        idn: String::new(),
        manifest: sequence.manifest.clone(),
        calibration: sequence.calibration,
        images: images.collect::<Result<_>>()?,
        frames: frames.collect(),
    });
    Ok(match &sequence.name {
        Some(name) => views.named(name),
        None => views,
    })
}

/// Answers requests of the kind `service`.
struct ServiceOperator {
    /// Path of the service channel.
    service: PathBuf,
}

impl Operator for ServiceOperator {
    fn answers(&self) -> &'static [&'static str] {
        &["service"]
    }

    fn answer(&self, request: &console::Request) -> Result<Value> {
        match request {
            console::Request::Service(request) => answer(&self.service, request),
            _ => Err(Error::device(
                "this device takes requests for its service channel only",
            )),
        }
    }
}

/// Asks a device, and returns its answer without the maps.
pub(super) fn answer(service: &Path, request: &Value) -> Result<Value> {
    let line = format!("{request}\n");
    let request = Request::parse(line.as_bytes());
    let request = request.map_err(|e| Error::device(e.to_string()))?;
    if let Request::Get(Item::Truth) | Request::TruthAt(_) | Request::TruthOfFrame(_) = request {
        return Err(Error::device(
            "a console does not pass maps on; ask the service channel itself",
        ));
    }
    let (reply, _) = ask_service(service, &request)?;
    serde_json::to_value(reply).map_err(Error::device)
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_protocol::PixelFormat;

    #[test]
    fn run_is_made_of_frames_that_follow_each_other() {
        let inbox = Inbox::default();
        let ids = |frames: &[(u64, Option<u32>)]| {
            for &(id, pattern_index) in frames {
                inbox.take(&Arc::new(Frame {
                    id,
                    pattern_index,
                    width: 1,
                    height: 1,
                    format: PixelFormat::Grey,
                    exposure_start_ns: 0,
                    exposure_end_ns: 1,
                    data: vec![0],
                }));
            }
            inbox
                .seen()
                .run
                .frames
                .iter()
                .map(|frame| frame.id)
                .collect::<Vec<_>>()
        };
        assert_eq!(ids(&[(3, None), (4, Some(1))]), [0u64; 0]);
        assert_eq!(ids(&[(5, Some(0)), (6, Some(1)), (7, Some(2))]), [5, 6, 7]);
        // A run ends at a missing pattern, at a repeated id, and when the sequence starts again.
        assert_eq!(ids(&[(8, Some(4))]), [0u64; 0]);
        assert_eq!(ids(&[(9, Some(0)), (9, Some(1))]), [0u64; 0]);
        assert_eq!(
            ids(&[(10, Some(0)), (11, Some(0)), (12, Some(1))]),
            [11, 12]
        );
        // A complete run is kept in `before` until the next run has ended.
        assert_eq!(ids(&[(13, None), (14, None)]), [0u64; 0]);
        assert_eq!(inbox.seen().before.frames.len(), 2);
        assert_eq!(ids(&[(15, Some(0))]), [15]);
        let seen = inbox.seen();
        assert_eq!((seen.before.number, seen.run.number), (4, 5));
    }
}
