//! `phasmid calibrate`: computes a rig from images of a board, taken by an emulated device or read from
//! captures.

mod captures;
mod coefficients;
#[cfg(target_os = "linux")]
mod emulated;
mod folder;
#[cfg(target_os = "linux")]
mod scene;
mod session;
#[cfg(not(target_os = "linux"))]
mod without_device;
#[cfg(not(target_os = "linux"))]
use without_device as emulated;

use super::backend;
use super::board_args::BoardArgs;
use super::interrupt::{check, watch_signals};
use super::progress::ProgressLine;
use super::set::SetArgs;
use super::step;
use emulated::Emulated;
use folder::Folder;
use phasmid_calibrate::files::{Reprojection, write_opencv};
use phasmid_calibrate::report::{self, About, Summary};
use phasmid_calibrate::rig::{Calibration, Missed, Poses};
use phasmid_calibrate::solve::{Choice, Unsolved};
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file::replace;
use phasmid_geometry::Board;
use phasmid_study::calibration::Truth;
use serde::Serialize;
use session::Gathered;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Folder for the captures of `--keep-captures`.
const CAPTURES: &str = "captures";
/// Files of the rig in OpenCV's formats.
const OPENCV: [&str; 2] = ["calibration.yml", "calibration.xml"];
/// File that compares the calibration with the true rig, which only an emulated device knows.
const TRUTH: &str = "truth.json";

/// Calibrate an emulated device, or any scanner from its captures, with images of a board in many
/// poses
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  phasmid calibrate --profile webcam-grey --poses 8 --out calibrated"
)]
pub(super) struct Args {
    /// Device profile to calibrate: a built-in name or a TOML file. The emulated device is shown a
    /// board and scanned over its ports
    #[arg(long, required_unless_present = "captures")]
    profile: Option<String>,
    #[command(flatten)]
    set: SetArgs,
    /// Captures to calibrate from: a folder with one folder per pose, as `phasmid scan --no-decode`
    /// writes it: images and their sequence.toml
    #[arg(long, value_name = "DIR", conflicts_with = "profile")]
    captures: Option<PathBuf>,
    #[command(flatten)]
    board: BoardArgs,
    /// Folder for the calibration and its report
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Distortion coefficients of the camera to estimate: auto (as many as the data require), none,
    /// all, or some of k1,k2,p1,p2,k3
    #[arg(long, value_name = "WHICH", default_value = "auto")]
    camera_distortion: coefficients::Choice,
    /// Distortion coefficients of the projector to estimate, as for the camera
    #[arg(long, value_name = "WHICH", default_value = "auto")]
    projector_distortion: coefficients::Choice,
    /// Number of poses in which the board is shown, 1 to 500
    #[arg(
        long,
        value_name = "N",
        default_value_t = 20,
        conflicts_with = "captures"
    )]
    poses: u32,
    /// Distance of the board in millimetres [default: the profile's, or where the fields of view of
    /// camera and projector meet]
    #[arg(long, value_name = "MM", conflicts_with = "captures")]
    distance_mm: Option<f64>,
    /// Maximum tilt of the board in degrees, 1 to 60
    #[arg(
        long,
        value_name = "DEG",
        default_value_t = 45.0,
        conflicts_with = "captures"
    )]
    max_tilt_deg: f64,
    /// Seed of the poses and of the noise
    #[arg(long, default_value_t = 1, conflicts_with = "captures")]
    seed: u64,
    /// Render without sensor noise
    #[arg(long, conflicts_with = "captures")]
    no_noise: bool,
    /// Rays per pixel: 1, 4, 16 or 64
    #[arg(
        long,
        value_name = "N",
        default_value_t = 1,
        conflicts_with = "captures"
    )]
    samples: u32,
    /// Where the render passes run
    #[arg(long, value_enum, default_value_t = backend::Choice::Cpu, conflicts_with = "captures")]
    backend: backend::Choice,
    /// Keep the frames of each pose in the folder captures, as `phasmid scan` writes them
    #[arg(long, conflicts_with = "captures")]
    keep_captures: bool,
    /// Overwrite an earlier calibration
    #[arg(long)]
    force: bool,
    /// Print the results as JSON
    #[arg(long)]
    json: bool,
}

/// The JSON output.
#[derive(Serialize)]
struct Figures<'a> {
    #[serde(flatten)]
    summary: &'a Summary,
    #[serde(skip_serializing_if = "Option::is_none")]
    truth: Option<&'a Truth>,
}

/// Runs the command.
///
/// # Errors
/// Returns an error if the captures, the board or an option are invalid, the poses do not determine
/// the rig, or the device fails.
pub(super) fn run(args: &Args) -> Result<()> {
    match (&args.profile, &args.captures) {
        (Some(name), _) => run_emulated(args, name),
        (None, Some(folder)) => run_captures(args, folder),
        (None, None) => Err(Error::input(
            "--profile",
            "neither it nor --captures is given",
            "--profile of a device, or --captures DIR",
        )),
    }
}

fn run_captures(args: &Args, folder: &Path) -> Result<()> {
    args.set.refuse("--captures uses no profile")?;
    let board = args.board.board(1.0)?;
    let poses = captures::poses(folder)?;
    watch_signals();
    let out = Folder::prepare(args, &[])?.sparing(&poses);
    let line = ProgressLine::new("poses");
    let looked = captures::look_at_all(&poses, &board, out.draft(), |done, of| line.show(done, of));
    drop(line);
    let Gathered { poses, images } = looked?;
    let place = format!("--captures {}", folder.display());
    if poses.poses.is_empty() {
        let (found, allowed) = no_board(&poses, &board);
        return Err(Error::input(place, found, allowed));
    }
    let remarks = vec![("captures".to_owned(), folder.display().to_string())];
    let calibration = solve(args, &board, &poses, &place)?;
    finish(args, out, &calibration, images, remarks, None)
}

fn run_emulated(args: &Args, name: &str) -> Result<()> {
    let device = Emulated::new(args, name)?;
    watch_signals();
    let out = Folder::prepare(args, &device.names())?;
    step("starting the device");
    let line = ProgressLine::new("poses");
    let scanned = device.scan(args, name, out.draft(), |done, of| line.show(done, of));
    drop(line);
    let (Gathered { poses, images }, idn) = scanned?;
    out.keep_captures()?;
    if poses.poses.is_empty() {
        let (found, allowed) = no_board(&poses, device.board());
        return Err(Error::device(format!(
            "{name}: {found}; expected {allowed}"
        )));
    }
    let place = format!("--poses {}", args.poses);
    let calibration = solve(args, device.board(), &poses, &place)?;
    let shown = device.shown();
    // The solution contains only the poses with a board.
    let given: Vec<_> = poses.places.iter().map(|&place| shown[place]).collect();
    let truth = Truth::new(&calibration.solution, device.truth(), &given);
    let remarks = [
        ("device", idn),
        ("profile", name.to_owned()),
        ("seed", args.seed.to_string()),
        (
            "noise",
            if args.no_noise {
                "none"
            } else {
                "the sensor's"
            }
            .to_owned(),
        ),
        (
            "distance from the truth",
            format!(
                "squared Mahalanobis distance {:.1} over {} parameters, 99 % bound {:.1}",
                truth.mahalanobis_squared, truth.degrees_of_freedom, truth.bound_99
            ),
        ),
    ];
    let remarks = remarks
        .map(|(name, value)| (name.to_owned(), value))
        .to_vec();
    finish(args, out, &calibration, images, remarks, Some(&truth))
}

/// Returns what was found and what was expected, for the case that no pose shows the board.
fn no_board(poses: &Poses, board: &Board) -> (String, String) {
    let [columns, rows] = board.grid();
    (
        format!(
            "no board in any of {} poses: {}",
            poses.missed.len(),
            reasons(&poses.missed)
        ),
        format!(
            "pictures of a board of {columns} x {rows} points, {} mm apart",
            board.pitch_mm()
        ),
    )
}

/// Lists in one line why poses cannot be used; poses with the same reason are grouped.
fn reasons(missed: &[Missed]) -> String {
    let mut together: Vec<(String, Vec<&str>)> = Vec::new();
    for Missed { name, why } in missed {
        let why = why.to_string();
        let why = why.split_whitespace().collect::<Vec<_>>().join(" ");
        match together.iter_mut().find(|(known, _)| *known == why) {
            Some((_, names)) => names.push(name),
            None => together.push((why, vec![name])),
        }
    }
    let words = |(why, names): &(String, Vec<&str>)| format!("{}: {why}", names.join(", "));
    together.iter().map(words).collect::<Vec<_>>().join("; ")
}

fn solve(args: &Args, board: &Board, poses: &Poses, place: &str) -> Result<Calibration> {
    step("solving");
    let choice = Choice {
        camera: args.camera_distortion.0,
        projector: args.projector_distortion.0,
        ..Choice::default()
    };
    let calibration = poses.calibrate(board, choice);
    calibration.map_err(|why| unsolved(&why, poses, place))
}

/// Converts a failed solution to an input error, because it takes other poses to resolve it.
fn unsolved(why: &Unsolved, poses: &Poses, place: &str) -> Error {
    let words = why.to_string();
    let (found, wanted) = words
        .split_once("; expected ")
        .unwrap_or((&words, "other poses"));
    let mut found = found.to_owned();
    if !poses.missed.is_empty() {
        let (many, why) = (poses.missed.len(), reasons(&poses.missed));
        found.push_str(&format!("; {many} other poses cannot be used: {why}"));
    }
    for warning in &poses.warnings {
        found.push_str("; ");
        found.push_str(warning);
    }
    Error::input(place, found, wanted)
}

fn finish(
    args: &Args,
    out: Folder,
    calibration: &Calibration,
    images: Vec<(String, String)>,
    remarks: Vec<(String, String)>,
    truth: Option<&Truth>,
) -> Result<()> {
    step("writing");
    let about = About {
        made_by: format!("phasmid calibrate {}", env!("CARGO_PKG_VERSION")),
        remarks,
        images,
    };
    if let Some(truth) = truth {
        let path = out.draft().join(TRUTH);
        replace(&path, |file| file.write_all(json(truth).as_bytes()))?;
    }
    for file in OPENCV {
        let (rig, errors) = (&calibration.solution.rig, errors(calibration));
        write_opencv(&out.draft().join(file), rig, &errors)?;
    }
    let summary = report::write(out.draft(), calibration, &about)?;
    check()?;
    out.finish()?;
    if args.json {
        let summary = &summary;
        print!("{}", json(&Figures { summary, truth }));
    } else {
        print!("{summary}");
        println!(
            "written to {}; report.html shows all results",
            args.out.display()
        );
    }
    Ok(())
}

/// Returns the RMS reprojection errors, which OpenCV's calibration reports as well.
fn errors(calibration: &Calibration) -> Reprojection {
    let (camera, projector) = (
        calibration.solution.camera_errors,
        calibration.solution.projector_errors,
    );
    let (n, m) = (camera.count as f64, projector.count as f64);
    let squares = n * camera.rms_px.powi(2) + m * projector.rms_px.powi(2);
    Reprojection {
        camera_px: Some(camera.rms_px),
        projector_px: Some(projector.rms_px),
        both_px: (n + m > 0.0).then(|| (squares / (n + m)).sqrt()),
    }
}

fn json(value: &impl Serialize) -> String {
    let text = serde_json::to_string_pretty(value).expect("numbers and strings");
    format!("{text}\n")
}
