//! `phasmid calibrate`: computes a rig from images of a board, taken by an emulated device or read from
//! captures.

mod args;
mod captures;
#[cfg(target_os = "linux")]
mod emulated;
mod folder;
mod session;
#[cfg(not(target_os = "linux"))]
mod without_device;
#[cfg(not(target_os = "linux"))]
use without_device as emulated;

pub(super) use args::Args;

use super::interrupt::{check, watch_signals};
use super::output::step;
use super::progress::ProgressLine;
use emulated::Emulated;
use folder::{Folder, OPENCV, TRUTH};
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
use std::path::Path;

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
            "neither this option nor --captures is given",
            "--profile PROFILE or --captures DIR",
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

/// Returns `found` and `expected` of the error message when no pose shows the board.
fn no_board(poses: &Poses, board: &Board) -> (String, String) {
    let [columns, rows] = board.grid();
    (
        format!(
            "no board in any of {} poses: {}",
            poses.missed.len(),
            reasons(&poses.missed)
        ),
        format!(
            "images of a board of {columns} x {rows} points, {} mm apart",
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

/// Converts a failed solution to an input error, because the user must provide other poses.
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
