//! What was found of each pod.

use crate::cli::pods::Address;
use glam::{DQuat, DVec3};
use phasmid_calibrate::solve::{Errors, Placed};
use phasmid_geometry::Pose;
use serde::Serialize;
use std::path::Path;

/// Points that leave more than so many times their noise were not seen by the rig that they are taken
/// for.
const MOST_WHITENED: f64 = 1.5;

/// A pod is hung to within so much of where it is drawn; one that is farther is another, or the board is
/// elsewhere.
const FAR_MM: f64 = 50.0;
const FAR_DEG: f64 = 5.0;

/// A pod's place.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Located {
    pub(super) name: String,
    /// Takes coordinates in the pod's rig to the room's.
    #[serde(skip)]
    pub(super) room_from_rig: Pose,
    /// The same as a station's file has it.
    position_mm: DVec3,
    rotation_deg: DVec3,
    camera: Group,
    projector: Group,
    /// Standard deviation of the board's middle as the pod sees it, length of the vector.
    deviation_mm: f64,
    /// And of its turn.
    deviation_deg: f64,
    /// How far the station's file has the board's middle from where it is, and by what angle it is
    /// turned there.
    off_mm: f64,
    off_deg: f64,
}

/// What points leave in one of the images.
#[derive(Debug, Clone, Copy, Serialize)]
struct Group {
    points: usize,
    rms_px: f64,
    /// In standard deviations.
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
    /// Of a pod before which the board was found, whose place in the room is known.
    pub(super) fn new(pod: &Address, placed: &Placed, room_from_board: &Pose) -> Self {
        let room_from_rig = *room_from_board * placed.rig_from_board.inverse();
        let (position_mm, rotation_deg) = room_from_rig.to_xyz_deg();
        let by_file = pod.room_from_rig * placed.rig_from_board;
        let turn = DQuat::from_mat3(&(by_file.rotation * room_from_board.rotation.transpose()));
        let spread = |axes: [usize; 3]| axes.map(|k| placed.covariance[k][k]).iter().sum::<f64>();
        Self {
            name: pod.name.clone(),
            room_from_rig,
            position_mm,
            rotation_deg,
            camera: Group::of(&placed.pose.camera_errors),
            projector: Group::of(&placed.pose.projector_errors),
            deviation_mm: spread([3, 4, 5]).sqrt(),
            deviation_deg: spread([0, 1, 2]).sqrt().to_degrees(),
            off_mm: (by_file.translation_mm - room_from_board.translation_mm).length(),
            off_deg: 2.0 * turn.xyz().length().atan2(turn.w.abs()).to_degrees(),
        }
    }

    /// The part of what its points leave that is largest over their noise, and in which image.
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

/// What a user should know before trusting it.
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
            "{}: the board's points are {:.1} times their noise off in the {what}'s image (RMS {:.3} \
             px), and the deviations below count that as noise",
            located.name, group.whitened_rms, group.rms_px
        ));
    }
    match loose_pods {
        0 => {}
        n if n == all.len() && n > 1 => warnings.push(
            "all pods say so: the board is not of the size that was said, or not flat".to_owned(),
        ),
        _ => warnings.push(
            "the calibration is not that of the pod as it is, or the board not of the size that was said"
                .to_owned(),
        ),
    }
    for located in all.iter().filter(|l| l.projector.points == 0) {
        warnings.push(format!(
            "{}: by the camera alone: nothing of the board was lit",
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
            "{}: more than {FAR_MM} mm or {FAR_DEG} degrees from where the station had it: is the board \
             where --board-position and --board-rotation say, and is each pod the one that it is called?",
            far.join(", ")
        ));
    }
    warnings
}

/// A short table, and where the file is.
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
        "{}: the station with the places that were found; off is what the one before said",
        out.display()
    );
}

/// The same for programs.
pub(super) fn print_json(all: &[Located]) {
    let text = serde_json::to_string_pretty(all).expect("numbers and words");
    println!("{text}");
}
