//! A patient in a treatment room, and the position of the patient in each scan.
//!
//! Positions are millimetres in the room frame: the fixed frame of IEC 61217 with its origin at the
//! isocentre, x to the right as seen from the foot end, y to the gantry, z up.

use crate::measurement::Field;
use serde::Serialize;

/// Triangles between points.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Surface {
    /// Positions in millimetres.
    pub vertices: Vec<[f32; 3]>,
    /// Indices of each triangle's corners.
    pub triangles: Vec<[u32; 3]>,
}

/// A treatment room with the plan of a patient.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Room {
    /// Names of the pods.
    pub pods: Vec<String>,
    /// Fields of view of the pods' cameras. The field of view of a pod is known after the pod's
    /// first scan.
    pub fields: Vec<Field>,
    /// Planned position of the tumour.
    pub target_mm: [f64; 3],
    /// Maximum distance of the tumour from `target_mm` at which the beam may be on, in millimetres.
    pub tolerance_mm: f64,
    /// The planned skin.
    #[serde(skip)]
    pub skin: Surface,
    /// The planned contour of the tumour.
    #[serde(skip)]
    pub tumour: Surface,
}

/// A value and its standard deviation.
pub type Stated = [f64; 2];

/// The result of a scan by all pods.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct RoomRow {
    /// Number of the scan, from 0.
    pub scan: u64,
    /// Device time in seconds; host time if the device reports none.
    pub time_s: f64,
    /// Displacement of the skin as a rigid body: shift along x, y and z in millimetres, then pitch, roll
    /// and yaw in degrees.
    pub skin: Option<[Stated; 6]>,
    /// Shift of the tumour from its planned position along x, y and z, then the length of the
    /// shift, in millimetres.
    pub tumour: Option<[Stated; 4]>,
    /// The true values of `tumour`, known only for an emulated patient.
    pub truth: Option<[f64; 4]>,
    /// Why the beam is held; `None` if it is on.
    pub held: Option<String>,
    /// Reasons to doubt the result.
    pub warnings: Vec<String>,
    /// Number of points of each pod.
    pub points: Vec<usize>,
    /// Fraction of the tracked skin that each pod sees.
    pub coverage: Vec<f64>,
    /// Fraction of the tracked skin that all pods together see, as computed by the motion model.
    pub covered: Option<f64>,
    /// Time from the arrival of the last frame to the result, in milliseconds.
    pub latency_ms: Option<f64>,
}

/// The patient in a scan.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RoomScan {
    /// Positions of the measured points in millimetres, then the distance of each from the planned
    /// skin, positive outside; NaN for a point beside the tracked part of the skin.
    pub points: Vec<[f32; 4]>,
    /// Vertices of the skin where it is tracked; empty if it is lost.
    pub skin: Vec<[f32; 3]>,
    /// Vertices of the tumour in the tracked position.
    pub tumour: Vec<[f32; 3]>,
}

/// A result as sent to the page; it replaces an earlier result with the same `id`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct KnownRow {
    pub(crate) id: u64,
    #[serde(flatten)]
    pub(crate) row: RoomRow,
}
