//! Internal state of a device as reported over the service channel.

use crate::faults::{Fault, Struck};
use phasmid_pattern::Pattern;
use serde::{Deserialize, Serialize};

/// How device time passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ClockPace {
    /// Real time.
    Real,
    /// Time jumps to the next event.
    Fast,
    /// Time stands still until a client advances it.
    Stepped,
}

impl ClockPace {
    /// All paces with their names.
    pub(super) const ALL: [(&str, Self); 3] = [
        ("real", Self::Real),
        ("fast", Self::Fast),
        ("stepped", Self::Stepped),
    ];
}

/// Device time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Clock {
    /// Clock mode.
    pub pace: ClockPace,
    /// Nanoseconds since power-on.
    pub now_ns: u64,
    /// In real time mode: lateness of event handling.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub late: Option<Late>,
    /// Speed of rendering; absent until a sequence's second frame or a free-running frame is rendered.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rendering: Option<Rendering>,
}

/// Speed at which frames are rendered, with any clock, over all devices of the server.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Rendering {
    /// Number of frames included: all free-running frames, and the frames of a sequence except its
    /// first.
    pub frames: u64,
    /// Device time over wall time: sum of the intervals at which these frames were exposed, divided by
    /// the sum of their render times; two significant digits. Above 1, devices keep up with the real
    /// clock.
    pub real_time_factor: f64,
}

/// Delay between due time and handling of events, in nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Late {
    /// Events since power-on, over all devices of the server.
    pub events: u64,
    /// Mean.
    pub mean_ns: u64,
    /// 99th percentile, overestimated by up to one eighth.
    pub percentile_99_ns: u64,
    /// Maximum.
    pub max_ns: u64,
}

/// Poses of the scene's objects at one time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Objects {
    /// Device time in nanoseconds.
    pub time_ns: u64,
    /// Pose of the device's rig in the scene.
    pub rig: PlaceAbout,
    /// Objects in the order of the scene file.
    pub objects: Vec<ObjectAbout>,
}

/// A pose in the scene's frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PlaceAbout {
    /// Origin in millimetres.
    pub position_mm: [f64; 3],
    /// Rotation in degrees about the fixed x, then y, then z axis.
    pub rotation_deg: [f64; 3],
}

/// An object of the scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ObjectAbout {
    /// Index of the object, from 0.
    pub object: u32,
    /// Name of its shape in scene files.
    pub shape: String,
    /// Whether it follows an animation and therefore cannot be placed.
    pub moves: bool,
    /// Whether its mesh deforms.
    pub deforms: bool,
    /// Its pose at that time.
    #[serde(flatten)]
    pub place: PlaceAbout,
    /// Internal anatomy of a patient.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub patient: Option<PatientAbout>,
}

/// State of a patient at one time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PatientAbout {
    /// Breathing phase, 0 to 1: 0 is end-inhale.
    pub phase: f64,
    /// Centroid of the tumour in the scene's frame in millimetres.
    pub tumour_mm: [f64; 3],
    /// Volume of the tumour in cubic millimetres.
    pub tumour_mm3: f64,
}

/// Ground truth of a frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameAbout {
    /// Id of the frame.
    pub id: u64,
    /// Position of the pattern in the sequence, as reported with the frame; `None` when running
    /// free.
    pub pattern_index: Option<u32>,
    /// First pattern that the projector showed during the exposure; `None` if its light was off.
    pub shown: Option<Shown>,
    /// Projector light relative to full current, 0 to 1.
    pub light: f64,
    /// Gain in decibels.
    pub gain_db: f64,
    /// Start of the exposure in nanoseconds of device time; with a rolling shutter, that of the
    /// first row.
    pub start_ns: u64,
    /// Exposure time in nanoseconds; with a rolling shutter, that of each row.
    pub exposure_ns: u64,
    /// End of the exposure in nanoseconds of device time; with a rolling shutter, that of the last
    /// row.
    pub end_ns: u64,
    /// Faults that affected the frame; the device remembers only the latest few thousand faults.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<Struck>,
    /// Poses of the objects half way between start and end.
    #[serde(flatten)]
    pub scene: Objects,
}

/// A pattern shown by the projector.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Shown {
    /// Sequence of the pattern; `None` for the pattern shown when idle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sequence: Option<String>,
    /// Position of the pattern in the sequence.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub index: Option<u32>,
    /// Description of the pattern; `None` if it is no longer in the device's memory.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pattern: Option<Pattern>,
}

/// The device's state and counters since power-on.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeviceAbout {
    /// Answer to `*IDN?`.
    pub name: String,
    /// `idle`, `free`, `armed` or `running`.
    pub state: String,
    /// Number of exposures, including free-running ones; equals the next frame's id.
    pub frames: u64,
    /// Number of rendered frames; exposures that no client would see are not rendered.
    #[serde(default)]
    pub rendered: u64,
    /// Triggers that arrived too early, since power-on or `*RST`.
    pub missed_triggers: u64,
    /// Number of fault occurrences.
    pub faults_struck: u64,
    /// Exposures whose frames have not left the device.
    pub in_flight: u64,
    /// Exposures that wait to be rendered.
    pub backlog: u64,
    /// Clients of the frame socket.
    pub camera_clients: u64,
    /// Bytes of frame data queued for these clients.
    pub camera_bytes: u64,
    /// Connections of the service socket.
    pub service_clients: u64,
    /// Bytes received on the control port.
    pub bytes_in: u64,
    /// Bytes sent on the control port.
    pub bytes_out: u64,
    /// Frames for which [`Request::TruthOfFrame`](super::Request::TruthOfFrame) is still available.
    pub history: u64,
}

/// A sequence in the device's memory.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SequenceAbout {
    /// Name of the sequence.
    pub name: String,
    /// Its manifest, in TOML.
    pub manifest: String,
}

/// A term of image formation.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct TermAbout {
    /// Pass that it belongs to: geometry, exposure or sensor.
    pub pass: String,
    /// Name.
    pub term: String,
    /// Whether it is computed.
    pub included: bool,
    /// Reason.
    pub why: String,
}

/// Faults of a device.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FaultsAbout {
    /// Names of the faults that a request can add.
    pub kinds: Vec<String>,
    /// Active faults, including those that have reached their maximum number of occurrences.
    pub standing: Vec<StandingFault>,
    /// Total number of fault occurrences since power-on.
    pub struck_in_all: u64,
    /// Latest [`MAX_STRUCK`] fault occurrences, in order.
    pub struck: Vec<Struck>,
}

/// Maximum number of occurrences listed by [`FaultsAbout`].
pub const MAX_STRUCK: usize = 256;

/// An active fault.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StandingFault {
    /// Fault id.
    pub id: u64,
    /// Number of its occurrences.
    pub struck: u64,
    /// The fault as requested.
    pub fault: Fault,
}
