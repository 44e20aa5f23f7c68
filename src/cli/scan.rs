//! `phasmid scan`: captures a sequence from any reachable device, and decodes it.

use super::decoding::{HeldArg, name_calibration};
use super::interrupt::{Unfinished, check, flow, unless_interrupted, watch_signals};
use super::method::MethodArgs;
use super::output::step;
use super::progress::ProgressLine;
use super::record::{Recording, folder_of};
use crate::facade::{endpoints_in, service_of, truth_maps};
use crate::{ScanOptions, Scanner, Truth};
use phasmid_calibrate::files::read_rig;
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file::{self, check_folder};
use phasmid_decode::{
    CALIBRATION_FILE, Capture, Known, MANIFEST_FILE, Options, Summary, check_modulation,
    doubt_of_fringes, output_names, write_outputs,
};
use phasmid_geometry::Rig;
use phasmid_host::usb::UsbAddress;
use phasmid_host::{CameraDriver, Progress, RecordedCamera, Tape, open_camera, scan_free_running};
use phasmid_pattern::Manifest;
use phasmid_protocol::dialect::Dialect;
use phasmid_protocol::endpoints;
use phasmid_protocol::service::SequenceAbout;
use std::ops::ControlFlow;
use std::path::{Component, Path, PathBuf};
use std::time::{Duration, Instant};

/// Capture a sequence from a scanner and decode it: frames, manifest, calibration, maps and cloud
#[derive(Debug, Clone, clap::Args)]
#[command(
    after_help = "Examples:\n  phasmid scan --camera /dev/video0 --control /dev/ttyACM0 --out scan\n  \
                  phasmid scan --run-dir run --out scan"
)]
pub(super) struct Args {
    /// Camera: /dev/videoN, socket:PATH or tcp:HOST:PORT. For tcp:, the environment variable
    /// PHASMID_TCP_TOKEN_FILE names the file of the device's --tcp-token.
    #[arg(long, value_name = "ADDR", required_unless_present_any = ["device", "run_dir"])]
    camera: Option<String>,
    /// USB device with camera and control port, served over USB/IP: usb:HOST:PORT or
    /// usb:HOST:PORT/BUSID.
    #[arg(long, value_name = "ADDR", conflicts_with_all = ["camera", "control", "capture"])]
    device: Option<String>,
    /// Directory of a served device, instead of the addresses: its device.json names them.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["camera", "control", "device", "dialect"])]
    run_dir: Option<PathBuf>,
    /// How to read a V4L2 camera
    #[arg(long, value_name = "HOW", default_value = "auto")]
    capture: How,
    /// Control port: the path of a serial port. Without one, --manifest states what is projected, and
    /// the frames of the free-running camera are taken as they arrive.
    #[arg(long, value_name = "PATH")]
    control: Option<String>,
    /// Dialect of the control port: scpi, dlpc350, okline, or a dialect file [default: that of the
    /// device.json beside the port, else scpi].
    #[arg(long, value_name = "NAME|FILE")]
    dialect: Option<String>,
    /// Folder for the capture and the results.
    #[arg(long, value_name = "DIR", default_value = "phasmid-scan")]
    out: PathBuf,
    /// Calibration to use instead of the device's own: calibration.toml, or OpenCV's YAML, XML or
    /// JSON, or SLStudio's formats, with image sizes.
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    #[command(flatten)]
    method: MethodArgs,
    /// Sequence to select on the device [default: the one selected there].
    #[arg(long, value_name = "NAME")]
    sequence: Option<String>,
    /// Manifest of what is projected, if the device does not report it.
    #[arg(long, value_name = "FILE")]
    manifest: Option<PathBuf>,
    /// Seconds to wait for a reply or a frame, 0.001 to 3600.
    #[arg(long, value_name = "S", default_value_t = 5.0)]
    timeout: f64,
    /// Keep mixed pixels, which see two surfaces at once.
    #[arg(long)]
    keep_mixed: bool,
    /// Weight the phase steps by their shot noise, which reduces noise with six or more equal steps.
    #[arg(long)]
    weighted: bool,
    /// Treatment of the error due to held projector pixels
    #[arg(long, value_name = "HOW", default_value = "correct")]
    held: HeldArg,
    /// Capture only, for sequences that are not meant to be decoded.
    #[arg(long)]
    no_decode: bool,
    /// Also write the truth of each pixel, if the device is emulated (device.json beside --control):
    /// truth.npz, and its depth as truth_depth.png in units of 0.1 mm.
    #[arg(long)]
    truth: bool,
    /// Record every byte and frame with its time, for `phasmid replay` and `phasmid record info`.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Overwrite an earlier capture, and the file of --record.
    #[arg(long)]
    force: bool,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

impl Args {
    /// Returns the arguments with the addresses that the run directory names.
    fn addressed(&self) -> Result<Self> {
        let mut args = self.clone();
        if let Some(dir) = &self.run_dir {
            let at = endpoints_in(dir).map_err(|e| e.at("--run-dir"))?;
            args.camera = Some(at.camera);
            args.control = Some(at.control.display().to_string());
        }
        Ok(args)
    }
}

/// How a V4L2 camera is read.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum How {
    /// v4l for GREY, Y10, Y10P, Y12, Y12P and Y16, else nokhwa
    Auto,
    /// Buffers queued by the driver (V4L2 streaming)
    V4l,
    /// The nokhwa library: YUYV and MJPG
    Nokhwa,
}

impl From<How> for CameraDriver {
    fn from(how: How) -> Self {
        match how {
            How::Auto => Self::Auto,
            How::V4l => Self::V4l,
            How::Nokhwa => Self::Nokhwa,
        }
    }
}

/// Maximum timeout in seconds.
const MAX_TIMEOUT_S: f64 = 3600.0;

pub(super) fn run(args: &Args) -> Result<()> {
    let args = &args.addressed()?;
    let range = 0.001..=MAX_TIMEOUT_S;
    if !range.contains(&args.timeout) {
        return Err(Error::input(
            "--timeout",
            args.timeout,
            format!("{} to {} s", range.start(), range.end()),
        ));
    }
    args.method.check()?;
    if args.device.is_none() && args.control.is_none() && args.manifest.is_none() {
        return Err(Error::input(
            "--control",
            "neither this option nor --manifest is given",
            "--control PATH for a triggered device, or --manifest FILE for a free-running camera",
        ));
    }
    if args.truth {
        // Reject these options before anything is captured.
        let Some(control) = &args.control else {
            let allowed = "--control or --run-dir of an emulated device";
            return Err(Error::input("--truth", "no control port", allowed));
        };
        service_of(Path::new(control)).map_err(|e| e.at("--truth"))?;
    }
    let free = args.device.is_none() && args.control.is_none();
    if let Some(name) = args.sequence.as_ref().filter(|_| free) {
        return Err(Error::input(
            format!("--sequence {name}"),
            "given without --control",
            "--control PATH, or --manifest alone",
        ));
    }
    let timeout = Duration::from_secs_f64(args.timeout);
    Capture::check_folder(&args.out, args.force)?;
    check_folder(&args.out, output_names(), args.force)?;
    check_places(args)?;
    let manifest = args.manifest.as_deref().map(Manifest::read).transpose();
    let manifest = manifest.map_err(|e| e.at("--manifest"))?;
    let calibration = args.calibration.as_deref().map(read_rig).transpose();
    let calibration = calibration.map_err(|e| e.at("--calibration"))?;
    if let Some(dialect) = &args.dialect {
        Dialect::load(dialect).map_err(|e| e.at("--dialect"))?;
    }
    if let Some(device) = &args.device {
        UsbAddress::parse(device, &format!("--device {device}"))?;
    }
    let start = Instant::now();
    let given = args.calibration.as_deref().zip(calibration);
    let address = args.device.as_deref().or(args.camera.as_deref());
    let address = address.unwrap_or_default();
    watch_signals();
    let folder = Unfinished::create("--out", &args.out, args.force)?;
    let (mut recording, tape) = match &args.record {
        Some(path) => {
            let control = args.control.as_deref().unwrap_or_default();
            let at = [address, control];
            let (recording, tape) = Recording::start(path, args.force, at, start)?;
            (Some(recording), Some(tape))
        }
        None => (None, None),
    };
    let noted = tape.clone();
    let on_frame = || {
        if let Some(recording) = &mut recording {
            recording.keep();
        }
    };
    let captured = match &manifest {
        Some(manifest) if free => {
            capture_free(args, address, manifest, timeout, given, tape, on_frame)
        }
        _ => {
            let options = ScanOptions {
                sequence: args.sequence.clone(),
                manifest,
                dialect: args.dialect.clone(),
                calibration,
                driver: args.capture.into(),
                reply_timeout: timeout,
                frame_timeout: timeout,
            };
            let control = args.control.as_deref().unwrap_or_default();
            step("connecting");
            let scanner = Scanner::recorded(address, control, options, tape);
            let captured = scanner.and_then(|scanner| capture(scanner, on_frame));
            captured.map_err(|e| name_calibration(e, args.calibration.as_deref()))
        }
    };
    if let (Some(tape), Ok(captured)) = (noted, &captured) {
        tape.note(note(captured, args.sequence.as_deref()));
    }
    let recorded = recording.map(|recording| recording.end(captured.as_ref().err()));
    let captured = captured?;
    let capture_s = start.elapsed().as_secs_f64();
    let source = match (given, captured.calibration) {
        (Some(_), _) => "file",
        (None, Some(_)) => "device",
        (None, None) => "none",
    };
    step("writing the frames");
    captured.write(folder.draft())?;
    // Keep the capture even if writing the truth fails; the error is returned at the end.
    let truth = match &args.control {
        Some(control) if args.truth => truth_into(folder.draft(), control),
        _ => Ok(()),
    };
    check()?;
    let mut earlier = Capture::frames_in(&args.out)?;
    let replaces = !earlier.is_empty() || args.out.join(MANIFEST_FILE).exists();
    earlier.extend(output_names().iter().map(PathBuf::from));
    earlier.extend(TRUTH.map(PathBuf::from));
    let decoded = (!args.no_decode)
        .then(|| decode_captured(&captured, args, folder.draft()))
        .transpose();
    let decoding = match decoded {
        Ok(decoding) => {
            folder.finish(earlier, Some(MANIFEST_FILE))?;
            decoding
        }
        // Discard the new frames, although they may show the cause of the error, because the earlier
        // result must be kept.
        Err(why) if replaces => return Err(why.at(address)),
        Err(why) => {
            discard_maps(folder.draft());
            folder.finish(earlier, Some(MANIFEST_FILE))?;
            let place = format!("{address} (frames kept in {})", args.out.display());
            return Err(why.at(place));
        }
    };
    truth.map_err(|e| e.at(format!("--truth (capture kept in {})", args.out.display())))?;
    let known = Known::new(false, captured.calibration.as_ref());
    let doubt = doubt_of_fringes(&captured.manifest, &captured.images, known);
    let doubt = doubt.map(|doubt| doubt.to_string());
    if let Some(why) = &doubt {
        eprintln!("phasmid: {address}: {why}");
    }
    report(&captured, args, source, capture_s, decoding.as_ref(), doubt);
    recorded.unwrap_or(Ok(()))
}

/// Rejects outputs that lie in the run directory of the device or would replace an input. Also rejects a
/// recording that has the name of another file of this scan or cannot be written.
fn check_places(args: &Args) -> Result<()> {
    let camera = args.camera.as_deref();
    let socket = camera.and_then(|address| address.strip_prefix("socket:"));
    let folders = [args.control.as_deref(), socket].into_iter().flatten();
    let folders = folders.map(|file| folder_of(Path::new(file)));
    let run_dirs: Vec<PathBuf> = folders
        .filter(|folder| folder.join(endpoints::FILE_NAME).is_file())
        .map(resolved)
        .collect();
    let in_run_dir = |path: &Path| run_dirs.iter().any(|dir| path.starts_with(dir));
    let out = resolved(&args.out);
    if in_run_dir(&out) {
        return Err(Error::input(
            format!("--out {}", args.out.display()),
            "the run directory of the device, or a folder in it",
            "a folder elsewhere: a run directory is only for the device's own files",
        ));
    }
    let dialect = args.dialect.as_deref().map(Path::new);
    let inputs = [
        ("--calibration", args.calibration.as_deref()),
        ("--manifest", args.manifest.as_deref()),
        ("--dialect", dialect),
    ];
    for (option, input) in inputs {
        let Some(input) = input.and_then(|input| input.canonicalize().ok()) else {
            continue;
        };
        if input.parent() == Some(&out) && is_written(&input) {
            return Err(Error::input(
                format!("--out {}", args.out.display()),
                format!("the folder of {option}, whose file the scan would overwrite"),
                "another folder",
            ));
        }
    }
    if args
        .method
        .reference()
        .is_some_and(|folder| resolved(folder) == out)
    {
        return Err(Error::input(
            format!("--out {}", args.out.display()),
            "the folder of --reference, which the scan would overwrite",
            "another folder",
        ));
    }
    let Some(path) = &args.record else {
        return Ok(());
    };
    let place = format!("--record {}", path.display());
    let folder = resolved(folder_of(path));
    if in_run_dir(&folder) {
        let found = "a file in the run directory of the device";
        return Err(Error::input(place, found, "a file elsewhere"));
    }
    if folder.starts_with(&out) {
        let found = format!("a file in the folder of --out, {}", args.out.display());
        return Err(Error::input(place, found, "a file elsewhere"));
    }
    for (option, input) in inputs {
        let same = |input: &Path| {
            let [file, input] = [path, input].map(Path::canonicalize);
            file.is_ok_and(|file| input.is_ok_and(|input| input == file))
        };
        if input.is_some_and(same) {
            let found = format!("the file of {option}");
            return Err(Error::input(place, found, "another file"));
        }
    }
    new_file::check(path, args.force).map_err(|e| e.at("--record"))
}

/// Returns whether a scan writes a file with this name, or deletes such a file of an earlier scan.
fn is_written(file: &Path) -> bool {
    let name = file.file_name().unwrap_or_default();
    let fixed = [MANIFEST_FILE, CALIBRATION_FILE];
    fixed.iter().chain(&TRUTH).any(|written| name == *written)
        || output_names().iter().any(|written| name == *written)
}

/// Returns an absolute path without symbolic links, even if the folder does not exist yet.
fn resolved(folder: &Path) -> PathBuf {
    let folder = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let existing = folder.ancestors().find_map(|ancestor| {
        let real = ancestor.canonicalize().ok()?;
        Some((real, folder.strip_prefix(ancestor).ok()?))
    });
    let Some((mut real, rest)) = existing else {
        return folder;
    };
    for part in rest.components() {
        match part {
            Component::ParentDir => {
                real.pop();
            }
            part => real.push(part),
        }
    }
    real
}

/// Files of the truth: all maps, and the depth as an image.
pub(super) const TRUTH: [&str; 2] = ["truth.npz", "truth_depth.png"];

/// Writes the files of the truth into a folder.
///
/// # Errors
/// Returns the system's error.
pub(super) fn write_truth(folder: &Path, truth: &Truth) -> Result<()> {
    truth.write_npz(&folder.join(TRUTH[0]))?;
    truth.write_depth_png(&folder.join(TRUTH[1]))
}

/// Asks an emulated device for the truth and writes its files into a folder.
fn truth_into(folder: &Path, control: &str) -> Result<()> {
    let service = service_of(Path::new(control))?;
    let maps = unless_interrupted(move || truth_maps(&service))?;
    write_truth(folder, &Truth::from_maps(maps)?)
}

/// Scans with a progress bar on a terminal, and calls `on_frame` after each frame. Ctrl-C ends the scan.
///
/// # Errors
/// Returns an error as [`Scanner::scan`] does.
pub(super) fn capture(mut scanner: Scanner, mut on_frame: impl FnMut()) -> Result<Capture> {
    let line = ProgressLine::new("capturing");
    let captured = scanner.scan_with(|progress| show(&line, progress, &mut on_frame));
    drop(line);
    let finished = scanner.finish();
    let captured = captured?;
    finished?;
    Ok(captured)
}

/// Rewords an error about `--manifest` or `--sequence` so that it names the dialect, for commands
/// that serve a device from a profile and lack these options of `scan`.
#[cfg(target_os = "linux")]
pub(super) fn blame_dialect(why: Error, profile: &str) -> Error {
    match why {
        Error::Input { place, found, .. }
            if place.contains("--manifest") || place.contains("--sequence") =>
        {
            Error::input(
                format!("profile {profile}: dialect"),
                found,
                "a dialect with select and manifest in its section [host]",
            )
        }
        why => why,
    }
}

/// Captures from a free-running camera, without a control port.
fn capture_free(
    args: &Args,
    camera: &str,
    manifest: &Manifest,
    timeout: Duration,
    calibration: Option<(&Path, Rig)>,
    tape: Option<Tape>,
    mut on_frame: impl FnMut(),
) -> Result<Capture> {
    eprintln!(
        "phasmid: no control port: nothing is triggered, the next {} frames are taken as they arrive",
        manifest.frame.len()
    );
    let mut camera = RecordedCamera::new(open_camera(camera, args.capture.into(), timeout)?, tape);
    let line = ProgressLine::new("capturing");
    let captured = scan_free_running(&mut camera, manifest, timeout, &mut |progress| {
        show(&line, progress, &mut on_frame)
    });
    drop(line);
    Ok(Capture {
        calibration: calibration.map(|given| given.1),
        ..captured?
    })
}

fn show(
    line: &ProgressLine,
    progress: Progress<'_>,
    mut on_frame: impl FnMut(),
) -> ControlFlow<()> {
    match progress {
        Progress::Identified(idn) => line.rename(idn),
        Progress::Frame { done, of } => {
            line.show(done, of);
            on_frame();
        }
        Progress::Retry(why) => eprintln!("phasmid: {why}; scanning again"),
        Progress::Waiting => {}
    }
    flow()
}

/// Returns the note of a recording about the sequence of a capture.
fn note(captured: &Capture, sequence: Option<&str>) -> String {
    let about = SequenceAbout {
        name: sequence.unwrap_or_default().to_owned(),
        manifest: captured.manifest.to_toml(),
    };
    about.to_note(captured.calibration.map(|rig| rig.to_toml()))
}

/// Result of decoding a capture.
struct Decoding {
    summary: Summary,
    decode_s: f64,
}

/// Deletes the maps after an error, because perhaps only some of them were written.
fn discard_maps(draft: &Path) {
    for name in output_names() {
        // If this fails, the map that remains is complete, because each map is first written under a
        // temporary name.
        let _ = std::fs::remove_file(draft.join(name));
    }
}

/// Decodes the capture into a folder.
fn decode_captured(captured: &Capture, args: &Args, out: &Path) -> Result<Decoding> {
    step("decoding");
    check_modulation(&captured.manifest, &captured.images)?;
    let options = Options {
        keep_mixed: args.keep_mixed,
        weighted: args.weighted,
        held: args.held.into(),
        ..Options::default()
    };
    let begin = Instant::now();
    let (decoder, mut decoded) = captured
        .decode(options)
        .map_err(|e| name_calibration(e, args.calibration.as_deref()))?;
    args.method.apply(&decoder, &mut decoded, options)?;
    let decode_s = begin.elapsed().as_secs_f64();
    write_outputs(out, &decoder, &decoded)?;
    let summary = Summary::new(&decoder, &decoded);
    if summary.points == Some(0) {
        return Err(Error::device("no pixel could be measured"));
    }
    Ok(Decoding { summary, decode_s })
}

fn report(
    captured: &Capture,
    args: &Args,
    calibration: &str,
    capture_s: f64,
    decoding: Option<&Decoding>,
    doubt: Option<String>,
) {
    if args.json {
        let summary = serde_json::json!({
            "idn": captured.idn,
            "frames": captured.images.len(),
            "first_id": captured.frames.first().map(|frame| frame.id),
            "calibration": calibration,
            "capture_s": capture_s,
            "decode_s": decoding.map(|d| d.decode_s),
            "decoding": decoding.map(|d| &d.summary),
            "doubt": doubt,
            "out": args.out,
        });
        println!("{summary}");
    } else {
        println!("device       {}", captured.idn);
        println!("calibration  {calibration}");
        match decoding {
            Some(Decoding {
                summary, decode_s, ..
            }) => {
                print!("{summary}");
                println!("time         captured in {capture_s:.2} s, decoded in {decode_s:.3} s");
            }
            None => {
                println!("frames       {}", captured.images.len());
                println!("time         captured in {capture_s:.2} s");
            }
        }
        println!("written      {}", args.out.display());
    }
}
