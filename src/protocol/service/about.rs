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
    /// It jumps to the next event.
    Fast,
    /// It stands still until it is advanced.
    Stepped,
}

/// Device time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Clock {
    /// How it passes.
    pub pace: ClockPace,
    /// Nanoseconds from power-on.
    pub now_ns: u64,
    /// In real time mode: lateness of event handling.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub late: Option<Late>,
}

/// Delay between due time and handling of events, in nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Late {
    /// Events since power-on, of all devices of the server.
    pub events: u64,
    /// Mean.
    pub mean_ns: u64,
    /// 99th percentile, overestimated by up to one eighth.
    pub percentile_99_ns: u64,
    /// The largest.
    pub max_ns: u64,
}

/// The objects of the scene at a time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Objects {
    /// Device time in nanoseconds.
    pub time_ns: u64,
    /// Where the device's rig stands in the scene.
    pub rig: PlaceAbout,
    /// In the order of the scene file.
    pub objects: Vec<ObjectAbout>,
}

/// A place in the scene's frame.
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
    /// Its number, from 0.
    pub object: u32,
    /// Its shape as scene files call it.
    pub shape: String,
    /// It moves along a path, and cannot be placed.
    pub moves: bool,
    /// Its mesh deforms.
    pub deforms: bool,
    /// Where it is at that time.
    #[serde(flatten)]
    pub place: PlaceAbout,
    /// Internal anatomy of a patient.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub patient: Option<PatientAbout>,
}

/// A patient at a time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PatientAbout {
    /// Breathing phase, 0 to 1: 0 is end-inhale.
    pub phase: f64,
    /// Centroid of the tumour in the scene's frame in millimetres.
    pub tumour_mm: [f64; 3],
    /// Its volume in cubic millimetres.
    pub tumour_mm3: f64,
}

/// Ground truth of a frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameAbout {
    /// The frame's identity.
    pub id: u64,
    /// Position of the pattern in the sequence, as the frame says; `None` when running free.
    pub pattern_index: Option<u32>,
    /// What the projector showed first; `None` with its light off.
    pub shown: Option<Shown>,
    /// Projector light relative to full current, 0 to 1.
    pub light: f64,
    /// Gain in decibels.
    pub gain_db: f64,
    /// Start of the exposure, of its first row, in nanoseconds of device time.
    pub start_ns: u64,
    /// Length of the exposure, of each row, in nanoseconds.
    pub exposure_ns: u64,
    /// End of the exposure, of its last row, in nanoseconds of device time.
    pub end_ns: u64,
    /// Faults that struck it, of the latest few thousand.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<Struck>,
    /// Where the objects were half way between start and end.
    #[serde(flatten)]
    pub scene: Objects,
}

/// What a projector showed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Shown {
    /// Sequence of the pattern; `None` for the pattern shown at rest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sequence: Option<String>,
    /// Its position there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub index: Option<u32>,
    /// What it is; `None` if it is no longer in the device's memory.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pattern: Option<Pattern>,
}

/// The device's state and counters since power-on.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeviceAbout {
    /// `*IDN?`.
    pub name: String,
    /// `idle`, `free`, `armed` or `running`.
    pub state: String,
    /// Exposures, free-running ones included; the next frame's id.
    pub frames: u64,
    /// Triggers that came too early, since power-on or `*RST`.
    pub missed_triggers: u64,
    /// Faults that have struck.
    pub faults_struck: u64,
    /// Exposures whose frames have not left the device.
    pub in_flight: u64,
    /// Exposures that wait for the optics.
    pub backlog: u64,
    /// Readers of the frame socket.
    pub camera_clients: u64,
    /// Bytes of frames that wait for them.
    pub camera_bytes: u64,
    /// Connections of the service socket.
    pub service_clients: u64,
    /// Bytes that came over the control port.
    pub bytes_in: u64,
    /// Bytes that went out over it.
    pub bytes_out: u64,
    /// Frames that [`Request::TruthOfFrame`](super::Request::TruthOfFrame) still knows.
    pub history: u64,
}

/// Faults of a device.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FaultsAbout {
    /// The faults in force, those that have struck as often as they may included.
    pub standing: Vec<StandingFault>,
    /// How often something has struck since power-on.
    pub struck_in_all: u64,
    /// What has struck, the latest [`MAX_STRUCK`] of it, in order.
    pub struck: Vec<Struck>,
}

/// Maximum number of occurrences listed by [`FaultsAbout`].
pub const MAX_STRUCK: usize = 256;

/// A fault in force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StandingFault {
    /// Its number.
    pub id: u64,
    /// How often it has struck.
    pub struck: u64,
    /// As it was given.
    pub fault: Fault,
}
