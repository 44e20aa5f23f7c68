//! `phasmid locate`: measures the poses of a station's pods in the room, with one board that all of them
//! see.

use super::board_args::BoardArgs;
use super::interrupt::uninterrupted;
use super::options::vector;
use super::pods::{Address, PodArgs, Source};
use glam::{DQuat, DVec3};
use phasmid_calibrate::rig::{look, place};
use phasmid_calibrate::solve::{Errors, Placed};
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file;
use phasmid_geometry::Pose;
use phasmid_profile::{Profile, Station, profile_names, scene_names};
use phasmid_protocol::dialect::Dialect;
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Maximum RMS residual of a pod's points, in standard deviations of their noise. A larger residual
/// means that the calibration or the size of the board is wrong.
const MOST_WHITENED: f64 = 1.5;

/// Maximum distance (mm) and angle (degrees) between a pod's measured pose and its pose in the
/// station file. Larger values mean that another pod was measured, or that the board is not at its
/// stated position.
const FAR_MM: f64 = 50.0;
const FAR_DEG: f64 = 5.0;

/// Measure the poses of pods in the room: each pod scans one board at a known pose, and the results are
/// written to a new station file
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  phasmid locate --run-dir mounted --timeout 60 --out located.toml"
)]
pub(super) struct Args {
    #[command(flatten)]
    pods: PodArgs,
    #[command(flatten)]
    board: BoardArgs,
    /// Position of the board's centre in the room, in millimetres [default: 0,0,0, the isocentre]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    board_position: Option<String>,
    /// Rotation of the board in degrees about the room's x, then y, then z axis. At 0,0,0 it lies face
    /// down with its columns along x and its rows along y [default: 180,0,0, face up]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    board_rotation: Option<String>,
    /// Sequence to show, with patterns along both axes [default: the profile's]
    #[arg(long, value_name = "NAME")]
    sequence: Option<String>,
    /// Station file to write, with the measured poses.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Overwrite an existing file.
    #[arg(long)]
    force: bool,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let timeout = args.pods.timeout()?;
    let room_from_board = args.room_from_board()?;
    new_file::check(&args.out, args.force)?;
    let mut measured = args.pods.station()?;
    let pods = args.pods.addresses(&measured)?;
    let mut all = Vec::new();
    for pod in &pods {
        super::output::step(&pod.name);
        all.push(locate(args, pod, &measured, &room_from_board, timeout)?);
    }
    for located in &all {
        move_to(&mut measured, &located.name, &located.room_from_rig);
    }
    uninterrupted(|| write_station(&measured, &args.out, args.force))?;
    for warning in warnings(&all) {
        eprintln!("phasmid: {warning}");
    }
    match args.json {
        true => print_json(&all),
        false => print_table(&all, &args.out),
    }
    Ok(())
}

impl Args {
    fn room_from_board(&self) -> Result<Pose> {
        let position_mm = self.board_position.as_deref();
        let rotation_deg = self.board_rotation.as_deref();
        let usual = DVec3::new(180.0, 0.0, 0.0);
        Ok(Pose::from_xyz_deg(
            position_mm.map_or(Ok(DVec3::ZERO), |text| {
                vector(
                    "--board-position",
                    text,
                    1e5,
                    "X,Y,Z in millimetres, up to 1e5",
                )
            })?,
            rotation_deg.map_or(Ok(usual), |text| {
                vector(
                    "--board-rotation",
                    text,
                    360.0,
                    "X,Y,Z in degrees, up to 360",
                )
            })?,
        ))
    }
}

/// Scans the board with one pod and estimates the pose of the pod.
fn locate(
    args: &Args,
    pod: &Address,
    station: &Station,
    room_from_board: &Pose,
    timeout: Duration,
) -> Result<Located> {
    let device = station.device.iter().find(|d| d.name == pod.name);
    let profile = device.map(|device| Profile::load(&station.profile(device)));
    let profile = profile.transpose()?;
    let scale = profile.as_ref().and_then(|p| p.calibration.board_scale);
    let board = args.board.board(scale.unwrap_or(1.0))?;
    let own = profile.as_ref().and_then(Profile::calibration_sequence);
    let own = own.map(|sequence| sequence.name.clone());
    let mut source = Source::open(pod, timeout)?;
    let scanned = match args.sequence.clone().or(own) {
        Some(sequence) => source.show(&sequence).and_then(|()| source.scan()),
        None => source.scan(),
    };
    let finished = source.finish();
    let captured = scanned?;
    finished?;
    let failed = |why: String| Error::device(format!("{}: {why}", pod.name));
    let Some(rig) = captured.calibration else {
        let why = "the device has no calibration; expected --calibration NAME=FILE";
        return Err(failed(why.to_owned()));
    };
    let looked = look(
        &board,
        &pod.name,
        &captured.manifest,
        &captured.images,
        Some(rig),
    )
    .map_err(|e| e.at(&pod.name))?;
    let data = looked.found.map_err(|e| failed(e.to_string()))?;
    let placed = place(&board, &data, &rig).map_err(|e| failed(e.to_string()))?;
    Ok(Located::new(pod, &placed, room_from_board))
}

/// A pod's measured pose and its quality.
#[derive(Debug, Clone, Serialize)]
struct Located {
    name: String,
    /// Maps coordinates in the pod's rig frame to the room's.
    #[serde(skip)]
    room_from_rig: Pose,
    /// `room_from_rig` as position and rotation, as a station file states a pose.
    position_mm: DVec3,
    rotation_deg: DVec3,
    camera: Group,
    projector: Group,
    /// Standard deviation of the board's position in the pod's rig frame, in mm: root of the sum of the
    /// squares over the three axes.
    deviation_mm: f64,
    /// Standard deviation of the board's orientation, in degrees.
    deviation_deg: f64,
    /// Distance in mm, and angle in degrees, between the measured pose of the board in the room,
    /// using the pod's pose in the given station file, and the pose that the user states.
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
    fn new(pod: &Address, placed: &Placed, room_from_board: &Pose) -> Self {
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

    /// Returns the name and residuals of the image (camera's or projector's) with the larger
    /// whitened residual.
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
fn warnings(all: &[Located]) -> Vec<String> {
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
             (RMS {:.3} px), and the standard deviations below treat them as noise",
            located.name, group.whitened_rms, group.rms_px
        ));
    }
    match loose_pods {
        0 => {}
        n if n == all.len() && n > 1 => warnings.push(
            "all pods have large residuals: the board does not have the given size, or is not flat".to_owned(),
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
fn print_table(all: &[Located], out: &Path) {
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
fn print_json(all: &[Located]) {
    let text = serde_json::to_string_pretty(all).expect("numbers and words");
    println!("{text}");
}

/// Replaces the pose of a device in the station by the measured pose.
fn move_to(station: &mut Station, name: &str, room_from_rig: &Pose) {
    let (position_mm, rotation_deg) = room_from_rig.to_xyz_deg();
    for device in station.device.iter_mut().filter(|d| d.name == name) {
        device.position_mm = Some(position_mm);
        device.rotation_deg = Some(rotation_deg);
    }
}

/// Writes a new station file. Its paths are absolute, so that it works from any folder.
///
/// # Errors
/// Returns an error if the file exists and `force` is not set, or if it cannot be written.
fn write_station(station: &Station, path: &Path, force: bool) -> Result<()> {
    let mut whole = station.clone();
    whole.scene = match station.scene() {
        Some(scene) => Some(anywhere(scene, scene_names())?),
        None => None,
    };
    for (device, of) in whole.device.iter_mut().zip(&station.device) {
        device.profile = anywhere(station.profile(of), profile_names())?;
        device.dialect = match station.dialect(of) {
            Some(dialect) => Some(anywhere(dialect, Dialect::names())?),
            None => None,
        };
    }
    let text = toml::to_string(&whole).expect("numbers and words");
    new_file::write(path, force, |out| {
        write!(out, "# Poses measured by `phasmid locate`.\n\n{text}")
    })
}

/// Returns a built-in name unchanged, and a file as an absolute path.
fn anywhere(name: String, mut built_in: impl Iterator<Item = &'static str>) -> Result<String> {
    if built_in.any(|known| known == name) {
        return Ok(name);
    }
    let path = std::path::absolute(&name).map_err(|e| Error::io(&name, e))?;
    Ok(path.display().to_string())
}
