//! Computes the position of the patient and the state of the beam from the captures of a scan.

use super::span::Span;
use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_decode::Capture;
use phasmid_geometry::Pose;
use phasmid_profile::RigPlace;
use phasmid_sgrt::{
    Answers, Beam, Follower, Hold, HoldRules, Measured, MotionFit, MotionState, POINTS, Planned,
    Quantity, Reading, RigidFit, ScanWarning, Sight,
};
use std::fmt;
use std::ops::RangeInclusive;
use std::time::{Duration, Instant};

/// Allowed tolerances of the tumour's position, in millimetres.
pub(crate) const TOLERANCE_MM: RangeInclusive<f64> = 0.001..=1000.0;

/// How a patient is tracked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackOptions {
    /// Maximum distance of the tumour from its planned position in millimetres, 0.001 to 1000. At a
    /// larger distance the beam is held.
    pub tolerance_mm: f64,
    /// Number of scans, 1 or more; `None` to track until the caller ends it.
    pub scans: Option<u64>,
    /// Duration of tracking on the device's clock, above zero; `None` for no limit. Tracking ends
    /// with the first scan whose [`Tracked::time`] is at least this much later than that of the
    /// first scan. If the links carry no times, the host's clock is used.
    pub duration: Option<Duration>,
    /// Rules that decide when the beam is held and when it is released.
    pub rules: HoldRules,
}

impl Default for TrackOptions {
    /// Returns options for a tolerance of 5 mm, an unlimited number of scans, no limit of time and the
    /// default rules.
    fn default() -> Self {
        Self {
            tolerance_mm: 5.0,
            scans: None,
            duration: None,
            rules: HoldRules::default(),
        }
    }
}

/// The result of one scan by all pods.
///
/// Coordinates are millimetres in the room frame: the fixed frame of IEC 61217 with its origin at the
/// isocentre, x to the right as seen from the foot end towards the gantry, y to the gantry, z up.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Tracked {
    /// Number of the scan, from 0.
    pub scan: u64,
    /// Device time at the end of the last exposure, counted from power-on; zero if the links carry no
    /// times.
    pub time: Duration,
    /// Device time halfway from the start of the first exposure to the end of the last; `None` if
    /// the links carry no times. If a patient moves uniformly, the measured surface is the
    /// patient's surface at this time.
    pub middle: Option<Duration>,
    /// Total number of points that the pods measured.
    pub points: usize,
    /// Pose of the skin, tracked as a rigid body; `None` if tracking has lost the skin.
    pub skin: Option<SkinPose>,
    /// Position of the tumour according to the motion model; `None` if tracking has lost the skin.
    pub tumour: Option<TumourPosition>,
    /// Whether the beam may be on.
    pub beam: Beam,
    /// Reasons to doubt the result. All of them hold the beam, except for [`ScanWarning::Rigid`] and
    /// [`ScanWarning::RigidLost`], which concern [`Self::skin`]: a breathing patient is not rigid.
    pub warnings: Vec<ScanWarning>,
    /// Time on the host's clock that decoding the captures took.
    pub decoding: Duration,
    /// Time on the host's clock from the arrival of the last frame to this result.
    pub latency: Duration,
    /// Time from [`Self::middle`] to this result: the device time from the middle to
    /// [`Self::time`], plus [`Self::latency`]. `None` if the links carry no times.
    pub since_motion: Option<Duration>,
}

/// Displacement of the skin from its planned position, about the isocentre, with standard deviations
/// that include the effect of light scattered inside the skin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkinPose {
    /// LAT, LNG and VRT (x, y and z) in millimetres.
    pub shift_mm: [f64; 3],
    /// Standard deviation of each, in millimetres.
    pub shift_sd_mm: [f64; 3],
    /// Pitch, roll and yaw (about x, y and z) in degrees, with `R = Rz(yaw) Rx(pitch) Ry(roll)`.
    pub rotation_deg: [f64; 3],
    /// Standard deviation of each, in degrees.
    pub rotation_sd_deg: [f64; 3],
}

impl SkinPose {
    fn of(fit: &RigidFit) -> Self {
        let [x, y, z, a, b, c] = fit.total_deviations();
        Self {
            shift_mm: fit.six.translation_mm.to_array(),
            shift_sd_mm: [x, y, z],
            rotation_deg: fit.six.rotation_deg.to_array(),
            rotation_sd_deg: [a, b, c],
        }
    }
}

/// Position of the tumour according to the motion model. The standard deviations include the effects of
/// light scattered inside the skin and of breathing that differs from planning.
#[derive(Debug, Clone, PartialEq)]
pub struct TumourPosition {
    /// Centroid in millimetres.
    pub position_mm: [f64; 3],
    /// Standard deviation of each coordinate, in millimetres.
    pub sd_mm: [f64; 3],
    /// Distance from the planned position in millimetres.
    pub off_mm: f64,
    /// Standard deviation of that distance, in millimetres.
    pub off_sd_mm: f64,
    /// Coefficients of the motion model, in units of their standard deviations during planning.
    pub modes: Vec<f64>,
    /// Standard deviation of each coefficient.
    pub modes_sd: Vec<f64>,
    /// RMS distance of the fitted points from the surface, in millimetres.
    pub rms_mm: f64,
    /// Fraction of the tracked part of the skin on which points were measured.
    pub coverage: f64,
}

impl TumourPosition {
    /// `target` is the planned position in the room frame, in millimetres.
    fn of(fit: &MotionFit, target: DVec3) -> Self {
        let covariance = fit.total_covariance(target);
        let off = fit.tumour_mm - target;
        let along = off.normalize_or(DVec3::Z);
        let sd = |variance: f64| variance.max(0.0).sqrt();
        let modes = fit.state.coefficients.clone();
        Self {
            position_mm: fit.tumour_mm.to_array(),
            sd_mm: [0, 1, 2].map(|axis| sd(covariance.col(axis)[axis])),
            off_mm: off.length(),
            off_sd_mm: sd(along.dot(covariance * along)),
            modes_sd: (0..modes.len())
                .map(|mode| sd(fit.covariance[(mode, mode)]))
                .collect(),
            modes,
            rms_mm: fit.rms_mm,
            coverage: fit.coverage,
        }
    }
}

/// Tracks a patient from captures of any origin: devices in memory, files, or scanners that the caller
/// drives. [`track`](fn@crate::track) does the same for scanners, while they scan.
///
/// ```
/// use phasmid::patient::phantom::{Patient, Phantom};
/// use phasmid::profile::{Profile, Scene};
/// use phasmid::track::Planned;
/// use phasmid::{Device, TrackOptions, Tracker};
/// use std::time::Duration;
///
/// # let scratch = tempfile::tempdir().expect("a temporary folder");
/// # let folder = scratch.path().join("planning");
/// let patient = Phantom::new(&Patient::load("p02-man-mean")?);
/// patient.export_planning(&folder, 12.0, false, false)?;
/// let planned = Planned::load(&folder)?;
///
/// let scene = Scene::load("treatment-room")?;
/// let mut tracker = Tracker::new(&planned, [("foot", scene.rig)], &TrackOptions::default())?;
/// let mut profile = Profile::load("sgrt-pod")?;
/// # (profile.camera.width_px, profile.camera.height_px) = (320, 240);
/// # profile.camera.sensor_width_mm /= 2.0;
/// let mut device = Device::builder().profile(profile).scene(scene).build()?;
/// for _ in 0..2 {
///     let tracked = tracker.scan(&[device.scan("pod-3")?])?;
///     println!("{:?}: {:?}", tracked.time, tracked.tumour);
///     assert!(tracked.tumour.is_some());
///     device.wait(Duration::from_millis(500)); // The patient breathes.
/// }
/// # Ok::<(), phasmid::Error>(())
/// ```
pub struct Tracker<'a> {
    follower: Follower<'a>,
    hold: Hold,
    pods: Vec<(String, Sight)>,
    /// Planned position of the tumour.
    target: DVec3,
    tolerance_mm: f64,
    /// Number of scans so far.
    scans: u64,
    /// The points of the last scan.
    measured: Measured,
    /// Pose and breathing fitted to `measured`; `None` if the skin is lost.
    state: Option<MotionState>,
}

impl fmt::Debug for Tracker<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Tracker")
            .field("scans", &self.scans)
            .field("beam", self.beam())
            .finish_non_exhaustive()
    }
}

/// The measurements of an incomplete scan, by the pods that have scanned so far.
#[derive(Default)]
pub(super) struct Gathered {
    measured: Measured,
    reading: Reading,
    span: Span,
    decoding: Duration,
    /// When the last frame arrived.
    arrived: Option<Instant>,
}

impl<'a> Tracker<'a> {
    /// Creates a tracker of a planned patient. `pods` are the names, for messages, and the places of
    /// the pods, as for [`Pod::new`](crate::Pod::new). The beam is held until scans allow it.
    /// [`TrackOptions::scans`] and [`TrackOptions::duration`] have no effect.
    ///
    /// # Errors
    /// Returns an error if there are no pods, if an option is out of range, or if the planning data do
    /// not match.
    pub fn new<'p>(
        planned: &'a Planned,
        pods: impl IntoIterator<Item = (&'p str, RigPlace)>,
        options: &TrackOptions,
    ) -> Result<Self> {
        if !TOLERANCE_MM.contains(&options.tolerance_mm) {
            let (least, most) = (TOLERANCE_MM.start(), TOLERANCE_MM.end());
            let allowed = format!("{least} to {most}");
            return Err(Error::input("tolerance_mm", options.tolerance_mm, allowed));
        }
        let sight = |(name, place): (&str, RigPlace)| {
            let room_from_rig = Pose::from_xyz_deg(
                DVec3::from_array(place.position_mm),
                DVec3::from_array(place.rotation_deg),
            );
            (name.to_owned(), Sight::new(name, room_from_rig))
        };
        let pods: Vec<_> = pods.into_iter().map(sight).collect();
        if pods.is_empty() {
            return Err(Error::input("pods", 0, "1 or more"));
        }
        Ok(Self {
            follower: Follower::new(planned)?,
            hold: Hold::new(options.rules)?,
            pods,
            target: planned.tumour_mm(),
            tolerance_mm: options.tolerance_mm,
            scans: 0,
            measured: Measured::default(),
            state: None,
        })
    }

    /// Evaluates a scan: a capture by each pod, in the order of the pods. All scans of a pod must
    /// have the sequence and the calibration of the pod's first scan.
    ///
    /// # Errors
    /// Returns an error if the number of captures is not that of the pods, if a capture has no
    /// calibration, or if it cannot be decoded.
    pub fn scan(&mut self, captures: &[Capture]) -> Result<Tracked> {
        if captures.len() != self.pods.len() {
            let allowed = format!("{}, one by each pod", self.pods.len());
            return Err(Error::input("captures", captures.len(), allowed));
        }
        let arrived = Instant::now();
        let mut gathered = Gathered::default();
        for (pod, capture) in captures.iter().enumerate() {
            // Frames without an identity have no pattern index, or `capture.frames` is empty.
            let frames = &capture.frames;
            let identified = !frames.is_empty() && frames.iter().all(|f| f.pattern_index.is_some());
            self.measure(pod, capture, identified, arrived, &mut gathered)?;
        }
        Ok(self.answer(gathered))
    }

    /// Returns the points of the last scan, in the room frame.
    pub fn measured(&self) -> &Measured {
        &self.measured
    }

    /// Returns pose and breathing of the patient in the last scan, for [`Planned::model`]; `None`
    /// if the skin is lost.
    pub fn state(&self) -> Option<&MotionState> {
        self.state.as_ref()
    }

    /// Returns the state of the beam.
    pub fn beam(&self) -> &Beam {
        self.hold.beam()
    }

    /// Holds the beam because the next scan is overdue, and returns the state of the beam.
    pub fn overdue(&mut self) -> &Beam {
        self.hold.silent()
    }

    /// Returns the maximum age of a scan. When the last scan is older, the beam is held.
    pub(super) fn stale(&self) -> Duration {
        self.hold.stale()
    }

    /// Returns the number of scans so far.
    pub(super) fn scans(&self) -> u64 {
        self.scans
    }

    /// Returns the number of pods.
    pub(super) fn pods(&self) -> usize {
        self.pods.len()
    }

    /// Returns the name of a pod.
    pub(super) fn name(&self, pod: usize) -> &str {
        &self.pods[pod].0
    }

    /// Adds the measurements of a pod's capture, whose last frame arrived at `arrived`. Set
    /// `identified` if the link identifies each frame.
    pub(super) fn measure(
        &mut self,
        pod: usize,
        capture: &Capture,
        identified: bool,
        arrived: Instant,
        gathered: &mut Gathered,
    ) -> Result<()> {
        let begin = Instant::now();
        let most = POINTS / self.pods.len();
        let (name, sight) = &mut self.pods[pod];
        let doubt = sight.measure(capture, identified, &mut gathered.measured, most)?;
        let rejected = doubt.map(|why| ScanWarning::Rejected {
            pod: name.clone(),
            why,
        });
        gathered.reading.warnings.extend(rejected);
        gathered.decoding += begin.elapsed();
        gathered.span.take(&capture.frames);
        gathered.arrived = gathered.arrived.max(Some(arrived));
        Ok(())
    }

    /// Fits the measurements of a scan by all pods, and decides on the beam.
    pub(super) fn answer(&mut self, gathered: Gathered) -> Tracked {
        let Gathered {
            measured,
            mut reading,
            span,
            decoding,
            arrived,
        } = gathered;
        let Answers { rigid, motion } = self.follower.answer(&measured);
        let tumour = motion
            .as_ref()
            .ok()
            .map(|fit| TumourPosition::of(fit, self.target));
        if let Some(tumour) = &tumour {
            reading.quantities.push(Quantity {
                name: "tumour",
                value: tumour.off_mm,
                deviation: tumour.off_sd_mm,
                tolerance: self.tolerance_mm,
            });
        }
        match &motion {
            Ok(fit) => {
                let warnings = fit.warnings.iter().cloned();
                reading.warnings.extend(warnings.map(ScanWarning::Fit));
            }
            Err(lost) => reading.warnings.push(lost.clone().into()),
        }
        let latency = arrived.map_or(Duration::ZERO, |arrived| arrived.elapsed());
        let beam = self.hold.update(span.end_ns, &reading).clone();
        let mut warnings: Vec<_> = match &rigid {
            Ok(fit) => fit
                .warnings
                .iter()
                .cloned()
                .map(ScanWarning::Rigid)
                .collect(),
            Err(lost) => vec![ScanWarning::RigidLost(lost.clone())],
        };
        warnings.append(&mut reading.warnings);
        let scan = self.scans;
        self.scans += 1;
        let points = measured.len();
        self.measured = measured;
        self.state = motion.as_ref().ok().map(|fit| fit.state.clone());
        let to_end = span.middle_to_end();
        Tracked {
            scan,
            time: span.end(),
            middle: to_end.map(|to_end| span.end() - to_end),
            points,
            skin: rigid.as_ref().ok().map(SkinPose::of),
            tumour,
            beam,
            warnings,
            decoding,
            latency,
            since_motion: to_end.map(|to_end| to_end + latency),
        }
    }
}
