//! `phasmid scan`: captures a sequence from any reachable device, and decodes it.

use super::decode::HeldArg;
use super::interrupt::{check, flow, unless_interrupted, watch_signals};
use super::method::MethodArgs;
use crate::facade::{endpoints_in, service_of, truth_maps};
use crate::{ScanOptions, Scanner, Truth};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use phasmid_calibrate::files::read_rig;
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file::{check_folder, stream};
use phasmid_core::output_folder::OutputFolder;
use phasmid_decode::{Capture, MANIFEST_FILE, Options, Summary, output_names, write_outputs};
use phasmid_geometry::Rig;
use phasmid_host::usb::UsbAddress;
use phasmid_host::{
    CameraDriver, Progress, RecordedCamera, Tape, check_modulation, monotonic_ns, open_camera,
    scan_free_running,
};
use phasmid_pattern::Manifest;
use phasmid_protocol::dialect::Dialect;
use phasmid_protocol::record::{About, Limits, Recorder, Side};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
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
            "neither it nor --manifest is given",
            "--control PATH for a triggered device, or --manifest FILE for a free-running camera",
        ));
    }
    if args.truth {
        // Before anything is captured.
        let Some(control) = &args.control else {
            let allowed = "--control or --run-dir of an emulated device";
            return Err(Error::input("--truth", "no control port", allowed));
        };
        service_of(Path::new(control)).map_err(|e| e.at("--truth"))?;
    }
    let timeout = Duration::from_secs_f64(args.timeout);
    Capture::check_folder(&args.out, args.force)?;
    check_folder(&args.out, output_names(), args.force)?;
    let manifest = args.manifest.as_deref().map(Manifest::read).transpose();
    let manifest = manifest.map_err(|e| e.at("--manifest"))?;
    let calibration = args.calibration.as_deref().map(read_rig).transpose();
    let calibration = calibration.map_err(|e| e.at("--calibration"))?;
    if let Some(dialect) = &args.dialect {
        Dialect::load(dialect).map_err(|e| e.at("--dialect"))?;
    }
    let start = Instant::now();
    let given = args.calibration.as_deref().zip(calibration);
    let address = args.device.as_deref().or(args.camera.as_deref());
    let address = address.unwrap_or_default();
    let tape = match &args.record {
        Some(path) => Some(tape(args, path, address, start)?),
        None => None,
    };
    if let Some(device) = &args.device {
        UsbAddress::parse(device, &format!("--device {device}"))?;
    }
    let free = args.device.is_none() && args.control.is_none();
    watch_signals();
    let captured = match &manifest {
        Some(manifest) if free => capture_free(args, address, manifest, timeout, given, tape)?,
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
            let scanner = Scanner::recorded(address, control, options, tape);
            let captured = scanner.and_then(capture);
            captured.map_err(|e| super::decode::name_calibration(e, args.calibration.as_deref()))?
        }
    };
    let capture_s = start.elapsed().as_secs_f64();
    let source = match (given, captured.calibration) {
        (Some(_), _) => "file",
        (None, Some(_)) => "device",
        (None, None) => "none",
    };
    let folder = OutputFolder::create(&args.out, args.force)?;
    captured.write(folder.draft())?;
    // The capture is kept if this fails.
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
        // The frames show the cause, but an earlier result is worth more.
        Err(why) if replaces => return Err(why.at(address)),
        Err(why) => {
            discard_maps(folder.draft());
            folder.finish(earlier, Some(MANIFEST_FILE))?;
            let place = format!("{address} (frames kept in {})", args.out.display());
            return Err(why.at(place));
        }
    };
    truth.map_err(|e| e.at(format!("--truth (capture kept in {})", args.out.display())))?;
    let of_maps = decoding
        .as_ref()
        .and_then(|decoding| decoding.doubt.clone());
    let doubt = phasmid_host::doubt(&captured.manifest, &captured.images).or(of_maps);
    if let Some(why) = &doubt {
        eprintln!("phasmid: {address}: {why}");
    }
    report(&captured, args, source, capture_s, decoding.as_ref(), doubt);
    Ok(())
}

/// Starts the recording of `--record`, whose times count from `start`.
fn tape(args: &Args, path: &Path, address: &str, start: Instant) -> Result<Tape> {
    let control = args.control.as_deref().unwrap_or_default();
    let now_ns = move || u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
    let about = About {
        side: Side::Host,
        program: concat!("phasmid ", env!("CARGO_PKG_VERSION")).into(),
        started_unix_s: super::record::unix_s(),
        name: if control.is_empty() { address } else { control }.to_owned(),
        control: control.to_owned(),
        camera: address.to_owned(),
        profile: None,
        scene: None,
        seed: None,
        monotonic_ns: Some(monotonic_ns().saturating_sub(now_ns())),
    };
    let file = stream(path, args.force).map_err(|e| e.at("--record"))?;
    let place = path.display().to_string();
    let notice = |text: &str| eprintln!("phasmid: {text}");
    let recorder = Recorder::start(file, &place, about, 0, Limits::default(), notice)?;
    Ok(Tape::new(recorder, now_ns))
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

/// Scans with a progress bar on a terminal. Ctrl-C ends the scan.
///
/// # Errors
/// Returns an error as [`Scanner::scan`] does.
pub(super) fn capture(mut scanner: Scanner) -> Result<Capture> {
    let bar = progress_bar();
    let captured = scanner.scan_with(|progress| show(&bar, progress));
    bar.finish_and_clear();
    let finished = scanner.finish();
    let captured = captured?;
    finished?;
    Ok(captured)
}

/// Captures from a free-running camera, without a control port.
fn capture_free(
    args: &Args,
    camera: &str,
    manifest: &Manifest,
    timeout: Duration,
    calibration: Option<(&Path, Rig)>,
    tape: Option<Tape>,
) -> Result<Capture> {
    if let Some(name) = &args.sequence {
        return Err(Error::input(
            format!("--sequence {name}"),
            "given without --control",
            "--control PATH, or --manifest alone",
        ));
    }
    eprintln!(
        "phasmid: no control port: nothing is triggered, the next {} frames are taken as they arrive",
        manifest.frame.len()
    );
    let mut camera = RecordedCamera::new(open_camera(camera, args.capture.into(), timeout)?, tape);
    let bar = progress_bar();
    let captured = scan_free_running(&mut camera, manifest, timeout, &mut |progress| {
        show(&bar, progress)
    });
    bar.finish_and_clear();
    Ok(Capture {
        calibration: calibration.map(|given| given.1),
        ..captured?
    })
}

fn progress_bar() -> ProgressBar {
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{msg} [{bar:30}] {pos}/{len}") {
        bar.set_style(style);
    }
    bar
}

fn show(bar: &ProgressBar, progress: Progress<'_>) -> ControlFlow<()> {
    match progress {
        Progress::Identified(idn) => bar.set_message(idn.to_owned()),
        Progress::Frame { done, of } => {
            bar.set_length(of as u64);
            bar.set_position(done as u64);
        }
        Progress::Retry(why) => bar.suspend(|| eprintln!("phasmid: {why}; once more")),
        Progress::Waiting => {}
    }
    flow()
}

/// Result of decoding a capture.
struct Decoding {
    summary: Summary,
    decode_s: f64,
    /// Why the maps should not be trusted.
    doubt: Option<String>,
}

/// Deletes maps of which only some were written.
fn discard_maps(draft: &Path) {
    for name in output_names() {
        // If this fails, the map is kept: a complete one, since each is written under another name.
        let _ = std::fs::remove_file(draft.join(name));
    }
}

/// Decodes the capture into a folder.
fn decode_captured(captured: &Capture, args: &Args, out: &Path) -> Result<Decoding> {
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
        .map_err(|e| super::decode::name_calibration(e, args.calibration.as_deref()))?;
    let doubt = decoded.doubt();
    args.method.apply(&decoder, &mut decoded, options)?;
    let decode_s = begin.elapsed().as_secs_f64();
    write_outputs(out, &decoder, &decoded)?;
    let summary = Summary::new(&decoder, &decoded);
    if summary.points == Some(0) {
        return Err(Error::device("no pixel could be measured"));
    }
    Ok(Decoding {
        summary,
        decode_s,
        doubt,
    })
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
