//! How the objects of a scene move and deform, by keyframes in device time.

use glam::DVec3;
use phasmid_core::check::Check;
use phasmid_core::error::Result;
use phasmid_geometry::{Timeline, Trajectory};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Keyframes closer together than this are a mistake.
const CLOSEST_S: f64 = 1e-6;
/// Most keyframes of a motion.
const MAX_KEYFRAMES: usize = 4096;
/// Most meshes of a deformation.
const MAX_MESHES: usize = 1024;

/// A rigid motion: poses through which an object passes, smoothly ([`Trajectory`] says how), in the
/// object's own frame. Without a period it stands still before the first and after the last one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Motion {
    /// Time in seconds after which the keyframes come again, without a seam.
    #[serde(default)]
    pub period_s: Option<f64>,
    /// At least two, their times ascending, less than a period from first to last.
    pub keyframes: Vec<Keyframe>,
}

/// A place on an object's way.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Keyframe {
    /// Device time, which power-on begins, in seconds.
    pub time_s: f64,
    /// Where the object is moved to, along its own axes, in millimetres: before its `rotation_deg`
    /// and `position_mm`, and not scaled.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly")]
    pub position_mm: [f64; 3],
    /// Its rotation there in degrees about its own x, then y, then z axis, fixed. The way from one
    /// keyframe to the next is the short one.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly")]
    pub rotation_deg: [f64; 3],
}

/// A deformation: meshes that an object's own becomes one after the other. Each vertex follows a
/// [`Timeline`]'s spline. It may move at the same time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Deform {
    /// Time in seconds after which the keyframes come again, without a seam.
    #[serde(default)]
    pub period_s: Option<f64>,
    /// At least two, their times ascending, less than a period from first to last.
    pub keyframes: Vec<MeshKeyframe>,
}

/// A shape on a mesh's way.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshKeyframe {
    /// Device time, which power-on begins, in seconds.
    pub time_s: f64,
    /// STL, OBJ or PLY, relative to the scene file, with the triangles of the object's own mesh over
    /// as many vertices; scaled as it is.
    pub file: PathBuf,
}

impl Motion {
    /// Whether some keyframe is elsewhere than where the object rests.
    pub fn goes_anywhere(&self) -> bool {
        let elsewhere = |k: &Keyframe| k.position_mm != [0.0; 3] || k.rotation_deg != [0.0; 3];
        self.keyframes.iter().any(elsewhere)
    }

    /// The pose over time that takes the object's coordinates to those that it has at rest.
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
    /// Which meshes make the shape at a moment.
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
            format!("times that ascend by {CLOSEST_S:e} s or more"),
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
        "more than from the first keyframe, which comes again, to the last",
    )
}
