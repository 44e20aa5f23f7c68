//! Plans poses of a calibration board that make a calibration well determined: tilted in all
//! directions, near and far, all over the image, and rotated in the plane.
//!
//! Zhang (IEEE PAMI 22, 2000, section 5) finds that tilts of about 45 degrees determine focal
//! lengths best and that parallel boards add nothing. At larger tilts foreshortening makes corners
//! less precise, so tilts are drawn between 15 and 45 degrees. Positions are drawn over the whole
//! image and then moved towards the middle of the field that camera and projector share until the
//! board is visible and illuminated. If no position works, for example because distant tilted dots
//! are too small, the tilt is reduced.
//!
//! `fit` tests whether a board is visible and illuminated in a pose.

mod fit;
#[cfg(test)]
mod tests;

use crate::{Board, Pose, Rig};
use fit::{Fit, Flaw};
use glam::{DMat3, DVec2, DVec3};
use phasmid_core::error::{Error, Result};
use std::f64::consts::TAU;
use std::ops::Range;

/// Number of steps from the drawn position to the middle of the shared field.
const STEPS: u32 = 20;
/// Fractions by which the drawn depth is moved towards the given distance and the drawn roll towards 0,
/// tried in turn until the board fits.
const EASE: [f64; 3] = [0.0, 0.5, 1.0];
/// Fractions by which the tilt is reduced towards the minimum, if nothing else helps.
const LEVEL: [f64; 6] = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0];
/// Columns and rows of the pixel grid that samples the field shared by camera and projector.
const GRID: u32 = 33;
/// Maximum number of poses of one calibration. The covariance matrix of 500 poses (six unknowns each)
/// takes 72 MB.
pub const MOST_POSES: usize = 500;

/// Parameters of the poses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wanted {
    /// Seed; equal seeds give equal poses.
    pub seed: u64,
    /// Number of poses.
    pub count: usize,
    /// Depth of the board's middle in the camera's frame in millimetres. If absent, the depth at
    /// which the centres of the camera's and the projector's fields meet.
    pub distance_mm: Option<f64>,
    /// Minimum and maximum tilt against the image plane in degrees. The tilt of a pose is reduced
    /// if the board would not be visible.
    pub tilt_deg: [f64; 2],
    /// Minimum and maximum depth relative to the distance.
    pub reach: [f64; 2],
    /// Maximum rotation about the board's normal in degrees, to either side.
    pub roll_deg: f64,
    /// Minimum length of the minor axis of a dot's image in pixels.
    pub least_dot_px: f64,
}

impl Default for Wanted {
    fn default() -> Self {
        Self {
            seed: 0,
            count: 20,
            distance_mm: None,
            tilt_deg: [15.0, 45.0],
            reach: [0.85, 1.15],
            roll_deg: 30.0,
            least_dot_px: 3.0,
        }
    }
}

/// Computes poses of a board (`rig_from_board`). A chessboard is completely visible to the camera and
/// illuminated by the projector; of a dot board, all markers and at least 60 % of the dots are visible
/// and illuminated.
///
/// # Errors
/// Returns an error, with numbers, if a parameter is out of range or the board cannot be shown to
/// this rig at this distance.
pub fn poses(board: &Board, rig: &Rig, wanted: &Wanted) -> Result<Vec<Pose>> {
    check(wanted)?;
    let distance = match wanted.distance_mm {
        Some(distance) => distance,
        None => rig
            .meeting_mm()
            .filter(|depth| (1.0..=1e6).contains(depth))
            .unwrap_or_else(|| filling_mm(board, rig)),
    };
    (0..wanted.count)
        .map(|index| pose(board, rig, wanted, distance, index))
        .collect()
}

fn check(wanted: &Wanted) -> Result<()> {
    let within = |place: &str, value: f64, low: f64, high: f64| match (low..=high).contains(&value)
    {
        true => Ok(()),
        false => Err(Error::input(place, value, format!("{low} to {high}"))),
    };
    within("poses", wanted.count as f64, 1.0, MOST_POSES as f64)?;
    if let Some(distance) = wanted.distance_mm {
        within("distance in mm", distance, 1.0, 1e6)?;
    }
    let [low, high] = wanted.tilt_deg;
    within("least tilt in degrees", low, 0.0, 60.0)?;
    within("greatest tilt in degrees", high, low, 60.0)?;
    let [near, far] = wanted.reach;
    within("least depth over distance", near, 0.1, 10.0)?;
    within("greatest depth over distance", far, near, 10.0)?;
    within("roll in degrees", wanted.roll_deg, 0.0, 180.0)?;
    within("least width of a dot in px", wanted.least_dot_px, 0.0, 1e6)
}

fn pose(board: &Board, rig: &Rig, wanted: &Wanted, distance: f64, index: usize) -> Result<Pose> {
    let [u, v, around, tilt, reach, roll] = numbers(wanted.seed, index);
    let between = |[low, high]: [f64; 2], share: f64| low + (high - low) * share;
    let drawn = Drawn {
        share: DVec2::new(u, v),
        around,
        tilt: 0.0,
        roll: between([-wanted.roll_deg, wanted.roll_deg], roll).to_radians(),
        reach: between(wanted.reach, reach),
    };
    let tilt = between(wanted.tilt_deg, tilt);
    let mut last = None;
    for level in LEVEL {
        let tilt = (tilt + (wanted.tilt_deg[0] - tilt) * level).to_radians();
        match placed(board, rig, wanted, distance, Drawn { tilt, ..drawn }) {
            Ok(pose) => return Ok(pose),
            Err(flaw) => last = Some(flaw),
        }
    }
    Err(name(last.unwrap_or_else(|| no_field(distance)), index))
}

/// The drawn pose, before any adjustment.
#[derive(Debug, Clone, Copy)]
struct Drawn {
    /// Position in the image, as fractions of its width and height.
    share: DVec2,
    /// Direction of the tilt, in full turns.
    around: f64,
    /// Tilt in radians.
    tilt: f64,
    /// Rotation about the board's normal in radians.
    roll: f64,
    /// Depth relative to the distance.
    reach: f64,
}

/// Finds a suitable pose with this tilt, as close to the drawn pose as possible.
fn placed(
    board: &Board,
    rig: &Rig,
    wanted: &Wanted,
    distance: f64,
    drawn: Drawn,
) -> Result<Pose, Flaw> {
    let Drawn {
        share,
        around,
        tilt,
        roll,
        reach,
    } = drawn;
    let lens = &rig.camera.lens;
    let size = DVec2::new(lens.width_px.into(), lens.height_px.into());
    let aim = share * size - 0.5;
    let mut last = None;
    // If the board is slightly too large or too small at the drawn depth, approach the given
    // distance.
    for ease in EASE {
        let depth = distance * (reach + (1.0 - reach) * ease);
        let Some(middle) = shared_middle(rig, depth) else {
            last = Some(no_field(depth));
            continue;
        };
        // On the outer half of the way to the middle, try the drawn tilt direction, then the opposite
        // direction; then both on the inner half.
        let (outer, inner) = (STEPS / 2..STEPS + 1, 0..STEPS / 2);
        let turns = |steps: Range<u32>| [(0.0, steps.clone()), (0.5, steps)];
        for (turn, steps) in turns(outer).into_iter().chain(turns(inner)) {
            for (step, ease) in steps.rev().flat_map(|s| EASE.map(|ease| (s, ease))) {
                let px = middle + (aim - middle) * (f64::from(step) / f64::from(STEPS));
                let around = (around + turn) * TAU;
                let axis = DVec3::new(around.cos(), around.sin(), 0.0);
                let rotation = DMat3::from_axis_angle(axis, tilt)
                    * DMat3::from_rotation_z(roll * (1.0 - ease));
                let camera_from_board = Pose {
                    rotation,
                    translation_mm: lens.ray(px) * depth,
                };
                let fit = Fit {
                    board,
                    rig,
                    rig_from_board: rig.camera.rig_from_view * camera_from_board,
                };
                match fit.check(wanted.least_dot_px) {
                    Ok(()) => return Ok(fit.rig_from_board),
                    Err(flaw) => last = Some(flaw),
                }
            }
        }
    }
    Err(last.unwrap_or_else(|| no_field(distance)))
}

fn name(flaw: Flaw, index: usize) -> Error {
    Error::input(format!("board, pose {index}"), flaw.found, flaw.allowed)
}

fn no_field(depth: f64) -> Flaw {
    Flaw {
        found: format!("no camera pixel sees the projector's light {depth:.0} mm away"),
        allowed: "a distance at which their fields meet".to_owned(),
    }
}

/// Mean of the camera pixels that see points illuminated by the projector at a depth.
fn shared_middle(rig: &Rig, depth: f64) -> Option<DVec2> {
    let lens = &rig.camera.lens;
    let size = DVec2::new(lens.width_px.into(), lens.height_px.into());
    let (mut sum, mut count) = (DVec2::ZERO, 0);
    for row in 0..GRID {
        for column in 0..GRID {
            let share = (DVec2::new(column.into(), row.into()) + 0.5) / f64::from(GRID);
            let px = share * size - 0.5;
            let point = rig.camera.rig_from_view.point(lens.ray(px) * depth);
            let lit = rig.projector.project(point);
            if lit.is_some_and(|lit| rig.projector.lens.contains(lit)) {
                sum += px;
                count += 1;
            }
        }
    }
    (count > 0).then(|| sum / f64::from(count))
}

/// Depth at which a board facing the camera fills half of the image.
fn filling_mm(board: &Board, rig: &Rig) -> f64 {
    let [columns, rows] = board.grid().map(f64::from);
    let lens = &rig.camera.lens;
    let wide = columns * lens.focal_px.x / f64::from(lens.width_px);
    let high = rows * lens.focal_px.y / f64::from(lens.height_px);
    (2.0 * board.pitch_mm() * wide.max(high)).clamp(1.0, 1e6)
}

/// Numbers per pose: column and row aimed at, direction and size of the tilt, distance, roll.
const NUMBERS: usize = 6;

/// Returns pose `index` of a sequence, each number in [0, 1). This is the additive recurrence whose
/// steps are the powers of 1 / phi, where phi is the root of x^7 = x + 1 (Roberts, "The
/// unreasonable effectiveness of quasirandom sequences", 2018). The seed determines its start.
fn numbers(seed: u64, index: usize) -> [f64; NUMBERS] {
    let mut phi = 1.5_f64;
    for _ in 0..50 {
        phi = (1.0 + phi).powf(1.0 / (NUMBERS as f64 + 1.0));
    }
    std::array::from_fn(|i| {
        let start = shift(seed, i as u64);
        (start + (index as f64 + 1.0) * phi.powi(-(i as i32 + 1))).fract()
    })
}

/// Pseudorandom number in [0, 1) from a seed: SplitMix64 (Steele, Lea, Flood, "Fast splittable
/// pseudorandom number generators", OOPSLA 2014).
fn shift(seed: u64, number: u64) -> f64 {
    let step = 0x9e37_79b9_7f4a_7c15_u64;
    let mut z = seed
        .wrapping_add(number.wrapping_mul(step.rotate_left(17)))
        .wrapping_add(step);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^= z >> 31;
    // Keep 53 bits, the precision of f64.
    (z >> 11) as f64 / (1u64 << 53) as f64
}
