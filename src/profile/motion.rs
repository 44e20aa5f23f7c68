//! Motion and deformation of scene objects by keyframes in device time.

use glam::DVec3;
use phasmid_core::check::Check;
use phasmid_core::error::Result;
use phasmid_geometry::{Timeline, Trajectory};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Minimum time between keyframes in seconds.
const CLOSEST_S: f64 = 1e-6;
/// Maximum number of keyframes of a motion.
const MAX_KEYFRAMES: usize = 4096;
/// Maximum number of meshes of a deformation.
const MAX_MESHES: usize = 1024;

/// A rigid motion: poses in the object's own frame, interpolated smoothly. Without a period the object
/// is at rest before the first and after the last keyframe.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Motion {
    /// Period in seconds after which the keyframes repeat without a discontinuity.
    #[serde(default)]
    pub period_s: Option<f64>,
    /// At least two keyframes, in ascending order of time, spanning less than a period.
    pub keyframes: Vec<Keyframe>,
}

/// A pose of a moving object.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Keyframe {
    /// Device time in seconds since power-on.
    pub time_s: f64,
    /// Translation along the object's own axes in millimetres, applied before the object's
    /// `rotation_deg` and `position_mm` and not affected by its scale.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly")]
    pub position_mm: [f64; 3],
    /// Rotation in degrees about the object's fixed x, then y, then z axis. Interpolation takes the
    /// shorter arc.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly")]
    pub rotation_deg: [f64; 3],
}

/// A deformation through a series of meshes that replace the object's own. Each vertex moves
/// smoothly through its keyframes. The object may also have a rigid `motion`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Deform {
    /// Period in seconds after which the keyframes repeat without a discontinuity.
    #[serde(default)]
    pub period_s: Option<f64>,
    /// At least two keyframes, in ascending order of time, spanning less than a period.
    pub keyframes: Vec<MeshKeyframe>,
}

/// The shape of a deforming mesh at one time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct MeshKeyframe {
    /// Device time in seconds since power-on.
    pub time_s: f64,
    /// STL, OBJ or PLY file, relative to the scene file, with the same triangles and the same
    /// number of vertices as the object's own mesh. The object's scale applies.
    pub file: PathBuf,
}

impl Motion {
    /// Returns whether any keyframe differs from the object's rest pose (no translation, no
    /// rotation).
    pub fn goes_anywhere(&self) -> bool {
        let elsewhere = |k: &Keyframe| k.position_mm != [0.0; 3] || k.rotation_deg != [0.0; 3];
        self.keyframes.iter().any(elsewhere)
    }

    /// Returns the pose over time that maps coordinates in the moving object's frame to its rest
    /// frame.
    pub fn trajectory(&self) -> Trajectory {
        let key = |k: &Keyframe| {
            (
                DVec3::from_array(k.position_mm),
                DVec3::from_array(k.rotation_deg),
            )
        };
        let keys: Vec<_> = self.keyframes.iter().map(key).collect();
        let times = self.keyframes.iter().map(|k| k.time_s).collect();
        Trajectory::new(Timeline::new(times, self.period_s), &keys)
    }
}

impl Deform {
    /// Returns the timeline that gives the meshes and weights at a time.
    pub fn timeline(&self) -> Timeline {
        let times = self.keyframes.iter().map(|k| k.time_s).collect();
        Timeline::new(times, self.period_s)
    }
}

pub(super) fn check(motion: &Motion, at: &str, check: &Check<'_>) -> Result<()> {
    let times: Vec<f64> = motion.keyframes.iter().map(|k| k.time_s).collect();
    check_times(&times, motion.period_s, MAX_KEYFRAMES, at, check)?;
    motion.keyframes.iter().enumerate().try_for_each(|(i, k)| {
        let field = |name: &str| format!("{at}.keyframes[{i}].{name}");
        check.all_within(&field("position_mm"), &k.position_mm, -1e9..=1e9)?;
        check.all_within(&field("rotation_deg"), &k.rotation_deg, -360.0..=360.0)
    })
}

pub(super) fn check_deform(deform: &Deform, at: &str, check: &Check<'_>) -> Result<()> {
    let times: Vec<f64> = deform.keyframes.iter().map(|k| k.time_s).collect();
    check_times(&times, deform.period_s, MAX_MESHES, at, check)?;
    deform.keyframes.iter().enumerate().try_for_each(|(i, k)| {
        check.that(
            !k.file.as_os_str().is_empty(),
            &format!("{at}.keyframes[{i}].file"),
            "an empty path",
            "the path of an STL, OBJ or PLY file",
        )
    })
}

fn check_times(
    times: &[f64],
    period_s: Option<f64>,
    most: usize,
    at: &str,
    check: &Check<'_>,
) -> Result<()> {
    check.that(
        (2..=most).contains(&times.len()),
        &format!("{at}.keyframes"),
        format!("{} keyframes", times.len()),
        format!("2 to {most} keyframes"),
    )?;
    let field = |i: usize| format!("{at}.keyframes[{i}].time_s");
    for (i, &time) in times.iter().enumerate() {
        check.within(&field(i), time, 0.0..=1e9)?;
    }
    for (i, pair) in times.windows(2).enumerate() {
        check.that(
            pair[1] - pair[0] >= CLOSEST_S,
            &field(i + 1),
            format!("{} after {}", pair[1], pair[0]),
            format!("ascending times, {CLOSEST_S:e} s or more apart"),
        )?;
    }
    let Some(period) = period_s else {
        return Ok(());
    };
    let place = format!("{at}.period_s");
    check.within(&place, period, CLOSEST_S..=1e9)?;
    let length = times[times.len() - 1] - times[0];
    check.that(
        period - length >= CLOSEST_S,
        &place,
        format!("{period} for keyframes over {length} s"),
        "more than the time from the first to the last keyframe",
    )
}
