//! `phasma scan`: captures a sequence from any device that can be reached.

use crate::error::{Error, Result};
use crate::geometry::Rig;
use crate::host::{Camera, Captured, Progress, ScanOptions, Scanner, SerialPort, open_camera};
use crate::pattern::Manifest;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Capture a sequence from a scanner: frames, manifest and calibration.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The camera: socket:PATH or tcp:HOST:PORT.
    #[arg(long, value_name = "ADDR")]
    camera: String,
    /// The control port: the path of a serial port.
    #[arg(long, value_name = "PATH")]
    control: String,
    /// Folder for what is captured.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Calibration to use in place of the device's own.
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Sequence to select on the device; the selected one when absent.
    #[arg(long, value_name = "NAME")]
    sequence: Option<String>,
    /// What the device projects, where it does not say so itself.
    #[arg(long, value_name = "FILE")]
    manifest: Option<PathBuf>,
    /// Seconds to wait for a reply or a frame.
    #[arg(long, value_name = "S", default_value_t = 5.0)]
    timeout: f64,
    /// Overwrite an earlier capture.
    #[arg(long)]
    force: bool,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

/// Longest timeout in seconds.
const MAX_TIMEOUT_S: f64 = 3600.0;
/// Larger than any calibration.
const MAX_CALIBRATION_BYTES: u64 = 1 << 20;

pub(super) fn run(args: &Args) -> Result<()> {
    let range = 0.001..=MAX_TIMEOUT_S;
    if !range.contains(&args.timeout) {
        return Err(Error::input(
            "--timeout",
            args.timeout,
            format!("{} to {} s", range.start(), range.end()),
        ));
    }
    let timeout = Duration::from_secs_f64(args.timeout);
    Captured::check_folder(&args.out, args.force)?;
    let manifest = args.manifest.as_deref().map(Manifest::read).transpose()?;
    let calibration = args.calibration.as_deref().map(read_rig).transpose()?;
    let options = ScanOptions {
        sequence: args.sequence.clone(),
        manifest,
        frame_timeout: timeout,
    };
    let start = Instant::now();
    let mut captured = capture(&args.camera, &args.control, timeout, &options)?;
    let capture_s = start.elapsed().as_secs_f64();
    let source = match (calibration, captured.calibration) {
        (Some(rig), _) => {
            captured.calibration = Some(rig);
            "file"
        }
        (None, Some(_)) => "device",
        (None, None) => "none",
    };
    captured.write(&args.out)?;
    decode_captured(&captured, &args.out)?;
    report(&captured, args, source, capture_s);
    Ok(())
}

/// Captures a sequence, with progress on a terminal.
///
/// # Errors
/// See [`Scanner::scan`].
pub(super) fn capture(
    camera: &str,
    control: &str,
    timeout: Duration,
    options: &ScanOptions,
) -> Result<Captured> {
    let port = SerialPort::open(control)?;
    let mut scanner: Scanner<Box<dyn Camera>, _> =
        Scanner::new(port, timeout, || open_camera(camera, timeout))?;
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{msg} [{bar:30}] {pos}/{len}") {
        bar.set_style(style);
    }
    let captured = scanner.scan(options, &mut |progress| match progress {
        Progress::Identified(idn) => bar.set_message(idn.to_owned()),
        Progress::Frame { done, of } => {
            bar.set_length(of as u64);
            bar.set_position(done as u64);
        }
        Progress::Retry(why) => bar.suspend(|| eprintln!("phasma: {why}; once more")),
    });
    bar.finish_and_clear();
    let finished = scanner.finish();
    let captured = captured?;
    finished?;
    Ok(captured)
}

fn read_rig(path: &Path) -> Result<Rig> {
    let size = std::fs::metadata(path)
        .map_err(|e| Error::io(path, e))?
        .len();
    if size > MAX_CALIBRATION_BYTES {
        return Err(Error::input(
            path.display(),
            format!("{size} bytes"),
            format!("a calibration of up to {MAX_CALIBRATION_BYTES} bytes"),
        ));
    }
    let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, e))?;
    Rig::from_toml(&text, &path.display().to_string())
}

/// Where decoding plugs in: frames, manifest and calibration are there, the folder exists.
fn decode_captured(_captured: &Captured, _out: &Path) -> Result<()> {
    Ok(())
}

fn report(captured: &Captured, args: &Args, calibration: &str, capture_s: f64) {
    if args.json {
        let summary = serde_json::json!({
            "idn": captured.idn,
            "frames": captured.frames.len(),
            "first_id": captured.frames.first().map(|frame| frame.id),
            "calibration": calibration,
            "capture_s": capture_s,
            "out": args.out,
        });
        println!("{summary}");
    } else {
        println!(
            "{}: {} frames in {capture_s:.2} s, calibration: {calibration}, in {}",
            captured.idn,
            captured.frames.len(),
            args.out.display()
        );
    }
}
