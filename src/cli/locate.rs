//! `phasmid locate`: measures the poses of a station's pods in the room, with one board that all of them
//! see.

mod report;
mod station;

use super::board_args::BoardArgs;
use super::interrupt::uninterrupted;
use super::pods::{Address, PodArgs, Source};
use super::vector::vector;
use glam::DVec3;
use phasmid_calibrate::rig::look;
use phasmid_calibrate::rig::place;
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file;
use phasmid_geometry::Pose;
use phasmid_profile::{Profile, Station};
use report::Located;
use std::path::PathBuf;
use std::time::Duration;

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
        station::move_to(&mut measured, &located.name, &located.room_from_rig);
    }
    uninterrupted(|| station::write(&measured, &args.out, args.force))?;
    for warning in report::warnings(&all) {
        eprintln!("phasmid: {warning}");
    }
    match args.json {
        true => report::print_json(&all),
        false => report::print(&all, &args.out),
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
