//! Results for each pod, and warnings about them.

use crate::cli::pods::Address;
use glam::{DQuat, DVec3};
use phasmid_calibrate::solve::{Errors, Placed};
use phasmid_geometry::Pose;
use serde::Serialize;
use std::path::Path;

/// Maximum RMS residual of a pod's points, in standard deviations of their noise. A larger one
/// means that the calibration or the size of the board is wrong.
const MOST_WHITENED: f64 = 1.5;

/// Maximum distance and angle between the measured pose and the pose in the station file. Larger
/// values mean that another pod was measured, or that the board is not where it was stated to be.
const FAR_MM: f64 = 50.0;
const FAR_DEG: f64 = 5.0;

/// A pod's measured pose and its quality.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Located {
    pub(super) name: String,
    /// Maps coordinates in the pod's rig frame to the room's.
    #[serde(skip)]
    pub(super) room_from_rig: Pose,
    /// The same pose as a station file stores it.
    position_mm: DVec3,
    rotation_deg: DVec3,
    camera: Group,
    projector: Group,
    /// Standard deviation of the board's position in the pod's rig frame: length of the vector, in mm.
    deviation_mm: f64,
    /// Standard deviation of the board's orientation, in degrees.
    deviation_deg: f64,
    /// Distance in mm, and angle in degrees, between the board's pose by the old station file and its
    /// given pose.
    off_mm: f64,
    off_deg: f64,
}

/// Residuals of the points in one of the images.
#[derive(Debug, Clone, Copy, Serialize)]
struct Group {
    points: usize,
    rms_px: f64,
    /// RMS residual in standard deviations of the noise.
    whitened_rms: f64,
}

impl Group {
    fn of(errors: &Errors) -> Self {
        Self {
            points: errors.count,
            rms_px: errors.rms_px,
            whitened_rms: errors.whitened_rms,
        }
    }
}

impl Located {
    /// Computes the pose of a pod from the board's pose in the pod's rig frame and in the room.
    pub(super) fn new(pod: &Address, placed: &Placed, room_from_board: &Pose) -> Self {
        let room_from_rig = *room_from_board * placed.rig_from_board.inverse();
        let (position_mm, rotation_deg) = room_from_rig.to_xyz_deg();
        let by_file = pod.room_from_rig() * placed.rig_from_board;
        let turn = DQuat::from_mat3(&(by_file.rotation * room_from_board.rotation.transpose()));
        let spread = |axes: [usize; 3]| axes.map(|k| placed.covariance[k][k]).iter().sum::<f64>();
        Self {
            name: pod.name.clone(),
            room_from_rig,
            position_mm: position_mm.into(),
            rotation_deg: rotation_deg.into(),
            camera: Group::of(&placed.pose.camera_errors),
            projector: Group::of(&placed.pose.projector_errors),
            deviation_mm: spread([3, 4, 5]).sqrt(),
            deviation_deg: spread([0, 1, 2]).sqrt().to_degrees(),
            off_mm: (by_file.translation_mm - room_from_board.translation_mm).length(),
            off_deg: 2.0 * turn.xyz().length().atan2(turn.w.abs()).to_degrees(),
        }
    }

    /// Returns the image with the larger whitened residual, and its residuals.
    fn worst(&self) -> (&'static str, &Group) {
        match self.projector.whitened_rms > self.camera.whitened_rms {
            true => ("projector", &self.projector),
            false => ("camera", &self.camera),
        }
    }

    fn is_far(&self) -> bool {
        self.off_mm > FAR_MM || self.off_deg > FAR_DEG
    }
}

/// Returns warnings about results that should not be trusted.
pub(super) fn warnings(all: &[Located]) -> Vec<String> {
    let mut warnings = Vec::new();
    let loose = all
        .iter()
        .filter(|l| l.worst().1.whitened_rms > MOST_WHITENED);
    let mut loose_pods = 0;
    for located in loose {
        let (what, group) = located.worst();
        loose_pods += 1;
        warnings.push(format!(
            "{}: the residuals of the board's points are {:.1} times their noise in the {what}'s image \
             (RMS {:.3} px), and the deviations below treat that as noise",
            located.name, group.whitened_rms, group.rms_px
        ));
    }
    match loose_pods {
        0 => {}
        n if n == all.len() && n > 1 => warnings.push(
            "this holds for all pods: the board does not have the given size, or is not flat".to_owned(),
        ),
        _ => warnings.push(
            "the pod's calibration is wrong or out of date, or the board does not have the given size"
                .to_owned(),
        ),
    }
    for located in all.iter().filter(|l| l.projector.points == 0) {
        warnings.push(format!(
            "{}: located with the camera alone: no point of the board was lit",
            located.name
        ));
    }
    let far: Vec<&str> = all
        .iter()
        .filter(|l| l.is_far())
        .map(|l| l.name.as_str())
        .collect();
    if !far.is_empty() {
        warnings.push(format!(
            "{}: more than {FAR_MM} mm or {FAR_DEG} degrees from the pose in the station file: check \
             --board-position, --board-rotation and the names of the pods",
            far.join(", ")
        ));
    }
    warnings
}

/// Prints a table, and the path of the station file.
pub(super) fn print(all: &[Located], out: &Path) {
    println!(
        "{:<10} {:>7} {:>5} {:>10} {:>13} {:>13} {:>14} {:>9} {:>10}",
        "pod",
        "points",
        "lit",
        "camera px",
        "projector px",
        "deviation mm",
        "deviation deg",
        "off mm",
        "off deg"
    );
    for located in all {
        println!(
            "{:<10} {:>7} {:>5} {:>10.4} {:>13.4} {:>13.4} {:>14.5} {:>9.4} {:>10.5}",
            located.name,
            located.camera.points,
            located.projector.points,
            located.camera.rms_px,
            located.projector.rms_px,
            located.deviation_mm,
            located.deviation_deg,
            located.off_mm,
            located.off_deg
        );
    }
    println!(
        "{}: station with the measured poses; off: difference from the previous station file",
        out.display()
    );
}

/// Prints the results as JSON.
pub(super) fn print_json(all: &[Located]) {
    let text = serde_json::to_string_pretty(all).expect("numbers and words");
    println!("{text}");
}
