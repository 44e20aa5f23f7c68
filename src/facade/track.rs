//! Tracking of a patient and a tumour with the pods of a treatment room.
//!
//! | file | contents |
//! | --- | --- |
//! | `tracker` | from the captures of a scan to positions and the state of the beam |
//! | `scan_deadline` | the deadline for the next scan, after which the beam is held |
//! | `span` | the exposure times of a scan's frames |

mod scan_deadline;
mod span;
mod tracker;

pub(crate) use tracker::TOLERANCE_MM;
pub use tracker::{SkinPose, TrackOptions, Tracked, Tracker, TumourPosition};

use super::Scanner;
use phasmid_core::error::{Error, Result};
use phasmid_decode::{Capture, FrameDoubt, Known, doubt_of_fringes};
use phasmid_host::{Flow, Progress};
use phasmid_profile::RigPlace;
use phasmid_sgrt::{Beam, Measured, MotionState, Planned};
use scan_deadline::{FOREVER, ScanDeadline};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};
use tracker::Gathered;

/// Maximum time between two progress reports while a scan is awaited.
const SLICE: Duration = Duration::from_millis(50);

/// A scanner at a known place in the treatment room.
#[derive(Debug)]
pub struct Pod {
    name: String,
    scanner: Scanner,
    place: RigPlace,
}

impl Pod {
    /// Creates a pod from a connected scanner; `name` appears in messages. `place` is the pose of its
    /// camera in the room frame, as in a station file
    /// ([`StationDevice::rig`](crate::profile::StationDevice::rig)): millimetres from the isocentre, and
    /// degrees about the room's x, then y, then z axis.
    pub fn new(name: impl Into<String>, scanner: Scanner, place: RigPlace) -> Self {
        Self {
            name: name.into(),
            // The tracker checks the frames while the next scan is running.
            scanner: scanner.without_checks(),
            place,
        }
    }

    /// Returns the pod's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the pod's place in the room.
    pub fn place(&self) -> RigPlace {
        self.place
    }

    /// Closes the ports as [`Scanner::finish`] does.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    pub fn finish(self) -> Result<()> {
        self.scanner.finish().map_err(|e| e.at(&self.name))
    }

    /// Scans once with this pod; ends the scan early if `ended` is set.
    fn scan(&mut self, ended: &AtomicBool) -> Result<Taken> {
        let mut arrived = Instant::now();
        let capture = self.scanner.scan_with(|progress| {
            if let Progress::Frame { .. } = progress {
                arrived = Instant::now();
            }
            match ended.load(Ordering::Relaxed) {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        });
        Ok(Taken {
            capture: capture.map_err(|e| e.at(&self.name))?,
            identified: self.scanner.identifies(),
            arrived,
        })
    }
}

/// A scan by one pod.
struct Taken {
    capture: Capture,
    /// Whether the link identifies each frame.
    identified: bool,
    /// When the last frame arrived.
    arrived: Instant,
}

/// Progress of tracking.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum TrackProgress<'a> {
    /// The surface of the scan that was reported last.
    Surface {
        /// The points of all pods that were fitted, in the room frame.
        measured: &'a Measured,
        /// Pose and breathing of the patient, for [`Planned::model`]; `None` if the skin is lost.
        state: Option<&'a MotionState>,
        /// The captures of the pods.
        captures: &'a [Arc<Capture>],
    },
    /// A scan by all pods was evaluated.
    Scan(&'a Tracked),
    /// The next scan is overdue, or will not come because a pod has failed, so the beam is held.
    /// This is reported once per missing scan, whatever the number of pods, at the deadline: three
    /// times the longest of the last five intervals between scans, and at least
    /// [`HoldRules::stale_ns`](phasmid_sgrt::HoldRules::stale_ns).
    Overdue {
        /// Number of the missing scan, from 0.
        scan: u64,
        /// The state of the beam: held.
        beam: &'a Beam,
    },
    /// The fringes in a pod's first scan are not sinusoidal, so the pod's points may be biased. This
    /// does not hold the beam.
    Doubtful {
        /// Name of the pod.
        pod: &'a str,
        /// The reason.
        why: &'a FrameDoubt,
    },
    /// A scan is awaited; reported at least ten times a second.
    Waiting,
}

/// A function that receives the progress of tracking and returns whether to go on.
type Watch<'a> = dyn FnMut(TrackProgress<'_>) -> ControlFlow<()> + 'a;

/// Tracks a patient: scans with one pod after the other, because their projectors take turns, and
/// evaluates each scan while the next one is running. `planned` is the patient in the planned
/// position, head first and supine. Coordinates are millimetres in the room frame: the fixed frame of
/// IEC 61217 with its origin at the isocentre.
///
/// `progress` receives every result on the calling thread. It may return `ControlFlow::Break(())`
/// to end tracking, which then succeeds. The call ends within 0.2 s or, if a query to a port is in
/// progress, when the port has replied or timed out. The pods can be used for another call;
/// [`Pod::finish`] closes their ports.
///
/// ```
/// # fn main() -> Result<(), phasmid::Error> {
/// use phasmid::patient::phantom::{Patient, Phantom};
/// use phasmid::profile::{Profile, Scene};
/// use phasmid::track::Planned;
/// use phasmid::{Device, Pod, ScanOptions, Scanner, ServeOptions, TrackOptions, TrackProgress};
///
/// # let scratch = tempfile::tempdir().expect("a temporary folder");
/// # let folder = scratch.path().join("planning");
/// let patient = Phantom::new(&Patient::load("p02-man-mean")?);
/// patient.export_planning(&folder, 12.0, false, false)?;
/// let planned = Planned::load(&folder)?;
///
/// let scene = Scene::load("treatment-room")?;
/// let place = scene.rig;
/// let mut profile = Profile::load("sgrt-pod")?;
/// // The central quarter of the image, to render less.
/// (profile.camera.width_px, profile.camera.height_px) = (320, 240);
/// profile.camera.sensor_width_mm /= 2.0;
/// let device = Device::builder().profile(profile).scene(scene).build()?;
/// let serving = device.serve(&ServeOptions::default())?;
/// let at = serving.endpoints();
///
/// let scanner = Scanner::connect(&at.camera, &at.control, ScanOptions::default())?;
/// let mut pods = [Pod::new("foot", scanner, place)];
/// let options = TrackOptions { scans: Some(1), ..TrackOptions::default() };
/// let mut tumour = None;
/// phasmid::track(&mut pods, &planned, &options, |progress| {
///     if let TrackProgress::Scan(tracked) = progress {
///         tumour = tracked.tumour.clone();
///     }
/// })?;
/// // On this day the patient lies a few millimetres from the planned position.
/// let off_mm = tumour.expect("the chest is in sight").off_mm;
/// assert!((1.0..8.0).contains(&off_mm), "{off_mm}");
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Returns an error if there are no pods, if an option is out of range, if the planning data do not
/// match, if a pod fails as in [`Scanner::scan`] or has no calibration, or if a capture cannot be
/// decoded. Frames that do not follow their sequence are no error: they add no points, and a warning
/// holds the beam.
pub fn track<F: Flow>(
    pods: &mut [Pod],
    planned: &Planned,
    options: &TrackOptions,
    mut progress: impl FnMut(TrackProgress<'_>) -> F,
) -> Result<()> {
    if options.scans == Some(0) {
        return Err(Error::input("scans", 0, "1 or more"));
    }
    if options.duration == Some(Duration::ZERO) {
        return Err(Error::input("duration", "0 s", "above 0 s"));
    }
    let places = pods.iter().map(|pod| (pod.name.as_str(), pod.place));
    let mut tracker = Tracker::new(planned, places, options)?;
    // The channel holds one capture per pod, so the pods are at most one scan ahead of the
    // evaluation.
    let (send, taken) = sync_channel(pods.len());
    let ended = AtomicBool::new(false);
    let (ends, wanted) = (&ended, options.scans);
    std::thread::scope(|threads| {
        let scanning = std::thread::Builder::new()
            .name("pods".into())
            .spawn_scoped(threads, move || scan_in_turn(pods, wanted, ends, &send));
        let scanning = scanning.map_err(|e| Error::device(format!("cannot start thread: {e}")))?;
        let progress: &mut Watch<'_> = &mut |what: TrackProgress<'_>| progress(what).flow();
        let followed = follow(&mut tracker, &taken, options, progress);
        // End the scan in progress; the closed channel ends the thread at its next send.
        ended.store(true, Ordering::Relaxed);
        drop(taken);
        let scanned = scanning
            .join()
            .unwrap_or_else(|_| Err(Error::device("the thread of the pods panicked")));
        // An error at the ports takes precedence over an error of the evaluation, because it is the
        // reason why the scans ended.
        scanned.and(followed)
    })
}

/// Scans with one pod after the other, until `ended` is set or nobody receives the scans.
fn scan_in_turn(
    pods: &mut [Pod],
    wanted: Option<u64>,
    ended: &AtomicBool,
    to: &SyncSender<Taken>,
) -> Result<()> {
    let mut count = 0;
    while wanted.is_none_or(|wanted| count < wanted) {
        for pod in &mut *pods {
            let taken = match pod.scan(ended) {
                Err(Error::Interrupted) => return Ok(()),
                taken => taken?,
            };
            if to.send(taken).is_err() {
                return Ok(());
            }
        }
        count += 1;
    }
    Ok(())
}

/// Evaluates and reports one scan after the other, until the scans end, the time limit is reached,
/// or `progress` ends tracking.
fn follow(
    tracker: &mut Tracker<'_>,
    scans: &Receiver<Taken>,
    options: &TrackOptions,
    progress: &mut Watch<'_>,
) -> Result<()> {
    let mut deadline = ScanDeadline::new(tracker.stale());
    let begin = Instant::now();
    // Time of the first scan.
    let mut first = None;
    loop {
        let mut gathered = Gathered::default();
        let mut captures = Vec::with_capacity(tracker.pods());
        let mut due = deadline.due(Instant::now());
        for pod in 0..tracker.pods() {
            let Some(taken) = next(tracker, scans, &mut due, options.scans, progress) else {
                return Ok(());
            };
            let Taken {
                capture,
                identified,
                arrived,
            } = taken;
            let known = Known::new(identified, capture.calibration.as_ref());
            if tracker.scans() == 0
                && let Some(why) = doubt_of_fringes(&capture.manifest, &capture.images, known)
            {
                let (pod, why) = (tracker.name(pod), &why);
                if progress(TrackProgress::Doubtful { pod, why }).is_break() {
                    return Ok(());
                }
            }
            tracker.measure(pod, &capture, identified, arrived, &mut gathered)?;
            captures.push(Arc::new(capture));
        }
        deadline.heard(Instant::now());
        let tracked = tracker.answer(gathered);
        if progress(TrackProgress::Scan(&tracked)).is_break() {
            return Ok(());
        }
        let surface = TrackProgress::Surface {
            measured: tracker.measured(),
            state: tracker.state(),
            captures: &captures,
        };
        if progress(surface).is_break() {
            return Ok(());
        }
        let time = match tracked.time {
            Duration::ZERO => begin.elapsed(),
            time => time,
        };
        let elapsed = time.saturating_sub(*first.get_or_insert(time));
        if options.duration.is_some_and(|limit| elapsed >= limit) {
            return Ok(());
        }
    }
}

/// Waits for the next scan by a pod; `None` if tracking has ended. If `due` passes, holds the beam
/// and postpones `due` forever, because a missing scan is reported once for all pods.
fn next(
    tracker: &mut Tracker<'_>,
    scans: &Receiver<Taken>,
    due: &mut Instant,
    wanted: Option<u64>,
    progress: &mut Watch<'_>,
) -> Option<Taken> {
    loop {
        let wait = due.saturating_duration_since(Instant::now()).min(SLICE);
        let flow = match scans.recv_timeout(wait) {
            Ok(taken) => return Some(taken),
            Err(RecvTimeoutError::Timeout) if Instant::now() >= *due => {
                *due = Instant::now() + FOREVER;
                hold(tracker, progress)
            }
            Err(RecvTimeoutError::Timeout) => progress(TrackProgress::Waiting),
            Err(RecvTimeoutError::Disconnected) => {
                if wanted != Some(tracker.scans()) && *tracker.beam() == Beam::On {
                    // Tracking ends whatever `progress` returns.
                    let _ = hold(tracker, progress);
                }
                return None;
            }
        };
        if flow.is_break() {
            return None;
        }
    }
}

/// Holds the beam because the next scan is missing, and reports that.
fn hold(tracker: &mut Tracker<'_>, progress: &mut Watch<'_>) -> ControlFlow<()> {
    let scan = tracker.scans();
    let beam = tracker.overdue();
    progress(TrackProgress::Overdue { scan, beam })
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use crate::{Device, ScanOptions, ServeOptions};
    use phasmid_phantom::{Patient, Phantom};
    use phasmid_sgrt::{HoldRules, ScanWarning};

    fn planned() -> Planned {
        let scratch = tempfile::tempdir().unwrap();
        let folder = scratch.path().join("planning");
        let patient = Phantom::new(&Patient::load("p02-man-mean").unwrap());
        let written = patient.export_planning(&folder, 20.0, false, false);
        written.unwrap();
        Planned::load(&folder).unwrap()
    }

    #[test]
    fn rejects_options_out_of_range() {
        let planned = planned();
        let refused = |options: &TrackOptions| {
            let tracker = Tracker::new(&planned, [("pod", RigPlace::default())], options);
            tracker.err().map(|e| e.to_string()).unwrap_or_default()
        };
        let words = refused(&TrackOptions {
            tolerance_mm: 0.0,
            ..TrackOptions::default()
        });
        assert_eq!(words, "tolerance_mm: 0; expected 0.001 to 1000");
        assert_eq!(refused(&TrackOptions::default()), "");
        let options = TrackOptions::default();
        let nobody = track(&mut [], &planned, &options, |_| ());
        let words = nobody.unwrap_err().to_string();
        assert_eq!(words, "pods: 0; expected 1 or more");
        let options = TrackOptions {
            duration: Some(Duration::ZERO),
            ..options
        };
        let no_time = track(&mut [], &planned, &options, |_| ());
        let words = no_time.unwrap_err().to_string();
        assert_eq!(words, "duration: 0 s; expected above 0 s");
    }

    /// A scan of a plane far from the planned skin.
    fn captured() -> Capture {
        let device = Device::builder().profile("webcam-grey").scene("plane");
        device.build().unwrap().scan("quick-4").unwrap()
    }

    #[test]
    fn overdue_scan_is_reported_once_for_all_pods() {
        let planned = planned();
        let capture = captured();
        let options = TrackOptions {
            rules: HoldRules {
                stale_ns: 1,
                ..HoldRules::default()
            },
            ..TrackOptions::default()
        };
        let pods = ["left", "right"].map(|name| (name, RigPlace::default()));
        let mut tracker = Tracker::new(&planned, pods, &options).unwrap();
        let (send, scans) = sync_channel(2);
        let scan = || {
            let taken = Taken {
                capture: capture.clone(),
                identified: true,
                arrived: Instant::now(),
            };
            assert!(send.send(taken).is_ok());
        };
        let mut overdue = Vec::new();
        scan();
        scan();
        let followed = follow(&mut tracker, &scans, &options, &mut |progress| {
            match progress {
                TrackProgress::Scan(tracked) if tracked.scan == 0 => {
                    scan();
                    scan();
                }
                TrackProgress::Scan(tracked) if tracked.scan == 2 => {
                    return ControlFlow::Break(());
                }
                // The scan of the first pod arrives after the deadline, and the scan of the second
                // pod later still.
                TrackProgress::Overdue { scan: number, .. } => {
                    overdue.push(number);
                    if overdue.len() == 1 {
                        scan();
                    }
                }
                TrackProgress::Waiting if !overdue.is_empty() => scan(),
                _ => {}
            }
            ControlFlow::Continue(())
        });
        followed.unwrap();
        assert_eq!(overdue, [2]);
    }

    #[test]
    fn capture_without_frame_information_is_not_identified() {
        let planned = planned();
        let mut capture = captured();
        // A capture whose frames are saturated is accepted only if the frames identify themselves.
        for image in &mut capture.images {
            for level in image.as_u8_mut().unwrap() {
                *level = level.saturating_mul(20);
            }
        }
        let rejected = |capture: &Capture| {
            let pods = [("pod", RigPlace::default())];
            let tracker = Tracker::new(&planned, pods, &TrackOptions::default());
            let tracked = tracker.unwrap().scan(std::slice::from_ref(capture));
            let warnings = tracked.unwrap().warnings;
            warnings
                .iter()
                .any(|warning| matches!(warning, ScanWarning::Rejected { .. }))
        };
        assert!(!rejected(&capture));
        capture.frames.clear();
        assert!(rejected(&capture));
    }

    #[test]
    fn ends_when_the_caller_breaks_and_the_pods_scan_again() {
        let planned = planned();
        let device = Device::builder().profile("webcam-grey").scene("plane");
        let device = device.build().unwrap();
        let serving = device.serve(&ServeOptions::default()).unwrap();
        let at = serving.endpoints();
        let scanner = Scanner::connect(&at.camera, &at.control, ScanOptions::default()).unwrap();
        let mut pods = [Pod::new("pod", scanner, RigPlace::default())];
        let mut broken = None;
        let options = TrackOptions::default();
        let ended = track(&mut pods, &planned, &options, |progress| match progress {
            TrackProgress::Scan(_) => {
                broken = Some(Instant::now());
                ControlFlow::Break(())
            }
            _ => ControlFlow::Continue(()),
        });
        ended.unwrap();
        // This takes 0.2 s on an idle machine.
        assert!(broken.unwrap().elapsed() < Duration::from_secs(2));
        let options = TrackOptions {
            scans: Some(1),
            ..options
        };
        let mut scans = Vec::new();
        let ended = track(&mut pods, &planned, &options, |progress| {
            if let TrackProgress::Scan(tracked) = progress {
                scans.push(tracked.clone());
            }
        });
        ended.unwrap();
        assert_eq!(scans.len(), 1);
        // The scan shows a plane far from the planned skin, so no tumour is located.
        assert_eq!((scans[0].scan, &scans[0].tumour), (0, &None));
        assert!(matches!(scans[0].beam, Beam::Held(_)));
        let lost = |warning: &ScanWarning| matches!(warning, ScanWarning::Lost(_));
        assert!(scans[0].warnings.iter().any(lost), "{scans:?}");
        // The limit is shorter than a scan, so tracking ends with the second scan.
        let options = TrackOptions {
            scans: None,
            duration: Some(Duration::from_millis(1)),
            ..options
        };
        let mut count = 0;
        let ended = track(&mut pods, &planned, &options, |progress| {
            if let TrackProgress::Scan(_) = progress {
                count += 1;
            }
        });
        ended.unwrap();
        assert_eq!(count, 2);
        let [pod] = pods;
        pod.finish().unwrap();
        serving.stop().unwrap();
    }
}
