//! `phasmid demo`: scans an emulated device through its ports and compares the result with the ground
//! truth.

use super::interrupt::{
    Unfinished, check, remove_run_dir_at_exit, unless_interrupted, watch_signals,
};
use super::method::MethodArgs;
use super::options::{BackendArg, SetArgs};
use super::output::{printed, step, tell};
use super::scan::{TRUTH, blame_dialect, capture, write_truth};
use crate::facade::truth_maps;
use crate::{ScanOptions, Scanner};
use image::GrayImage;
use phasmid_core::error::{Error, Result};
use phasmid_core::file;
use phasmid_core::new_file::{check_folder, replace};
use phasmid_decode::{Capture, Options, Summary as Decoding};
use phasmid_device::Device;
use phasmid_device::link::ServeOptions;
use phasmid_geometry::{Rig, ply};
use phasmid_pattern::Samples;
use phasmid_profile::Profile;
use phasmid_protocol::service::ClockPace;
use phasmid_render::Options as RenderOptions;
use phasmid_render::truth::Truth;
use phasmid_study::report::{PICTURES, Summary, write_images};
use phasmid_study::score::score;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Start an emulated scanner, scan it through its serial port and camera, and compare the surface
/// with the ground truth
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  phasmid demo --profile webcam-grey --scene sphere --out demo")]
pub struct Args {
    /// Folder for frames, cloud, images and results
    #[arg(long, value_name = "DIR", default_value = "phasmid-demo")]
    out: PathBuf,
    /// Device profile: a built-in name or a TOML file
    #[arg(long, default_value = "pmp-bench")]
    profile: String,
    /// Scene in front of the device: a built-in name or a TOML file
    #[arg(long, default_value = "torso")]
    scene: String,
    #[command(flatten)]
    set: SetArgs,
    /// Seed of the noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Rays per pixel: 1, 4, 16 or 64. More rays resolve details thinner than a pixel and take
    /// proportionally longer, once per scene
    #[arg(long, value_name = "N", default_value_t = 1)]
    samples: u32,
    /// Instants per exposure at which a moving scene is rendered, 1 to 256; each takes as long as
    /// rendering a static scene once
    #[arg(long, value_name = "N", default_value_t = 4)]
    time_samples: u32,
    /// Maximum error in projector pixels, 0 to 1, of geometry that is interpolated between instants
    /// of a moving scene; 0 computes the geometry at every instant
    #[arg(long, value_name = "PX", default_value_t = RenderOptions::default().motion_tolerance_px)]
    motion_tolerance: f64,
    /// Where the render passes run
    #[arg(long, value_enum, default_value_t = BackendArg::Cpu)]
    backend: BackendArg,
    /// Render without sensor noise
    #[arg(long)]
    no_noise: bool,
    /// Let the device report its exact rig instead of a factory calibration with errors
    #[arg(long)]
    exact_calibration: bool,
    /// Weight the phase steps by their shot noise, which reduces noise with six or more equal steps
    #[arg(long)]
    weighted: bool,
    #[command(flatten)]
    method: MethodArgs,
    /// Also write the truth of each pixel: truth.npz, and its depth as truth_depth.png in units of 0.1 mm
    #[arg(long)]
    truth: bool,
    /// Print the results as JSON
    #[arg(long)]
    json: bool,
}

/// Timeout for a reply or a frame. The first frame waits until the scene is prepared.
const TIMEOUT: Duration = Duration::from_secs(30);
/// File of the results. It also marks a folder as the output of a demo.
const SUMMARY: &str = "summary.json";
const CLOUD: &str = "cloud.ply";

pub(super) fn run(args: &Args) -> Result<()> {
    let mut laps = Laps::start();
    args.method.check()?;
    check_out(&args.out, args.truth)?;
    step("preparing the device");
    let (profile, device) = device(args)?;
    watch_signals();
    let folder = Unfinished::create("--out", &args.out, is_demo(&args.out))?;
    step("starting the device");
    // Declare `_run_dir` before the device, so that it is dropped after the device.
    let _run_dir;
    let served = device.serve(&ServeOptions {
        clock: ClockPace::Fast,
        notice: printed(),
        ..ServeOptions::default()
    })?;
    let endpoints = served.endpoints();
    _run_dir = remove_run_dir_at_exit(&endpoints.control);
    let start_s = laps.lap_s();
    let options = ScanOptions {
        reply_timeout: TIMEOUT,
        frame_timeout: TIMEOUT,
        ..ScanOptions::default()
    };
    let scanner = Scanner::connect(&endpoints.camera, &endpoints.control, options)?;
    let captured = capture(scanner, || ());
    let captured = captured.map_err(|why| blame_dialect(why, &args.profile))?;
    let capture_s = laps.lap_s();
    step("decoding");
    check()?;
    let reported = captured
        .calibration
        .ok_or_else(|| no_calibration(&args.profile))?;
    let truth_rig = Rig {
        noise: reported.noise,
        ..profile.nominal_rig()
    };
    let options = Options {
        weighted: args.weighted,
        ..Options::default()
    };
    let (decoder, mut decoded) = captured.decode(options)?;
    args.method.apply(&decoder, &mut decoded, options)?;
    let decode_s = laps.lap_s();
    step("asking for the truth");
    let service = endpoints.service.clone();
    let maps = unless_interrupted(move || truth_maps(&service))?;
    let render_s = maps.render_us as f64 * 1e-6;
    let truth = Truth::from_maps(maps)?;
    served.stop()?;
    step("comparing");
    let score = score(&decoded, &truth, &captured.manifest, &truth_rig)?;
    let compare_s = laps.lap_s();
    step("writing");
    check()?;
    let frame = seen(&captured)?;
    let draft = folder.draft();
    captured.write(draft)?;
    ply::write_cloud(&draft.join(CLOUD), &decoder.cloud(&decoded))?;
    write_images(draft, &frame, &decoded, &truth, &truth_rig)?;
    if args.truth {
        write_truth(draft, &truth)?;
    }
    let decoding = Decoding::new(&decoder, &decoded);
    let calibration_sigma_mm = decoding.median_calibration_sigma_mm;
    let masked = decoding
        .axes
        .into_iter()
        .flat_map(|axis| axis.masked)
        .collect();
    let summary = Summary {
        made_by: format!("phasmid demo {}", env!("CARGO_PKG_VERSION")),
        device: captured.idn.clone(),
        profile: args.profile.clone(),
        scene: args.scene.clone(),
        seed: args.seed,
        noise: !args.no_noise,
        frames: captured.images.len(),
        calibration: match reported.covariance {
            Some(_) => "factory",
            None => "exact",
        },
        calibration_sigma_mm,
        score,
        masked,
        truth: args.truth,
        start_s,
        render_s,
        capture_s,
        decode_s,
        compare_s,
        write_s: laps.lap_s(),
        total_s: laps.total_s(),
    };
    let json = serde_json::to_string_pretty(&summary).expect("numbers and strings");
    replace(&draft.join(SUMMARY), |out| writeln!(out, "{json}"))?;
    check()?;
    let mut earlier = Capture::frames_in(&args.out)?;
    if args.truth || has_truth(&args.out) {
        earlier.extend(TRUTH.map(PathBuf::from));
    }
    folder
        .finish(earlier, Some(SUMMARY))
        .map_err(without_force)?;
    if args.json {
        println!("{json}");
    } else {
        print!("{summary}");
        println!(
            "{}: frame_*.png, {CLOUD}, {}, {SUMMARY}",
            args.out.display(),
            PICTURES
                .into_iter()
                .chain(TRUTH.into_iter().filter(|_| args.truth))
                .collect::<Vec<_>>()
                .join(", ")
        );
    }
    if summary.score.points == 0 {
        return Err(Error::device(format!(
            "no point was measured: profile {} sees or lights nothing of scene {}",
            args.profile, args.scene
        )));
    }
    Ok(())
}

/// A stopwatch for successive phases of the command.
struct Laps {
    start: Instant,
    last: Instant,
}

impl Laps {
    fn start() -> Self {
        let start = Instant::now();
        Self { start, last: start }
    }

    /// Returns the seconds since the last call.
    fn lap_s(&mut self) -> f64 {
        let last = std::mem::replace(&mut self.last, Instant::now());
        self.last.duration_since(last).as_secs_f64()
    }

    /// Returns the seconds from the start to the end of the last phase.
    fn total_s(&self) -> f64 {
        self.last.duration_since(self.start).as_secs_f64()
    }
}

/// Error for a device that reports no calibration.
fn no_calibration(profile: &str) -> Error {
    Error::device(format!(
        "profile {profile}: the device reported no calibration; expected a dialect with calibration \
         in its [host]"
    ))
}

/// Returns the first image of the capture, converted to 8 bits so that the camera's full scale is
/// 255.
fn seen(captured: &Capture) -> Result<GrayImage> {
    let image = captured
        .images
        .first()
        .ok_or_else(|| Error::device("the device gave no frame"))?;
    let full = captured
        .calibration
        .and_then(|rig| rig.noise)
        .map_or(f64::from(u16::MAX), |noise| noise.saturation_dn);
    let levels = match image.samples() {
        Samples::U8(levels) => levels.clone(),
        Samples::U16(levels) => {
            let scaled = levels.iter().map(|level| f64::from(*level) / full * 255.0);
            scaled.map(|level| level as u8).collect()
        }
    };
    let size = (image.width() as u32, image.height() as u32);
    Ok(GrayImage::from_raw(size.0, size.1, levels).expect("as many levels as pixels"))
}

/// Builds the device.
fn device(args: &Args) -> Result<(Profile, Device)> {
    let options = RenderOptions {
        samples: args.samples,
        time_samples: args.time_samples,
        motion_tolerance_px: args.motion_tolerance,
        backend: args.backend.into(),
    };
    let (mut profile, scene) = args.set.load(&args.profile, &args.scene)?;
    profile.camera.sensor.noiseless |= args.no_noise;
    profile.factory_calibration.exact |= args.exact_calibration;
    let device = Device::builder(&profile, &scene).seed(args.seed);
    let mut device = device.options(options).build()?;
    tell(&args.profile, &mut device)?;
    Ok((profile, device))
}

/// Rejects a folder that contains files with names of results, unless an earlier demo wrote them.
fn check_out(out: &Path, truth: bool) -> Result<()> {
    let force = is_demo(out);
    let truth = TRUTH.into_iter().filter(|_| truth);
    let names = [SUMMARY, CLOUD].into_iter().chain(PICTURES).chain(truth);
    let checked = check_folder(out, names, force);
    let checked = checked.and_then(|()| Capture::check_folder(out, force));
    checked.map_err(without_force)
}

/// Replaces the hint about `--force` in an error, because this command has no such option.
fn without_force(why: Error) -> Error {
    match why {
        Error::Input {
            place,
            found,
            expected,
        } if expected.contains("--force") => Error::input(
            place,
            found,
            "a folder without such files, or one that a demo has written",
        ),
        why => why,
    }
}

/// Returns whether an earlier demo wrote a truth into the folder.
fn has_truth(out: &Path) -> bool {
    let summary = file::read(&out.join(SUMMARY), 1 << 20).unwrap_or_default();
    let summary: serde_json::Value = serde_json::from_slice(&summary).unwrap_or_default();
    summary["truth"] == true
}

/// Returns whether an earlier demo wrote the folder.
fn is_demo(out: &Path) -> bool {
    let summary = file::read(&out.join(SUMMARY), 1 << 20).unwrap_or_default();
    String::from_utf8_lossy(&summary).contains("\"made_by\": \"phasmid demo")
}
