//! `phasmid console`: a page in the browser that shows a scanner and operates it.

use super::interrupt;
use crate::facade::{Playback, ScanOptions, endpoints_in, operate, watch_camera};
use phasmid_calibrate::files::read_rig;
use phasmid_console::{Console, ConsoleOptions, Sequence};
use phasmid_core::error::Result;
use phasmid_host::CameraDriver;
use phasmid_pattern::Manifest;
use phasmid_protocol::dialect::Dialect;
use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;

/// Time between two checks for an interrupt.
const LOOK: Duration = Duration::from_millis(100);

/// Show a scanner in the browser and operate it, until Ctrl-C
///
/// Opens the camera, emulated or physical, and prints the address of a page that shows its frames. With a
/// control port, the page also scans and has a terminal; the port is opened only then. To see a device
/// beside another program, use `phasmid serve --console`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  phasmid console --run-dir run\n  phasmid console --camera /dev/video0 --control /dev/ttyUSB0"
)]
pub(super) struct Args {
    /// Camera: /dev/videoN, socket:PATH or tcp:HOST:PORT.
    #[arg(long, value_name = "ADDR", required_unless_present_any = ["run_dir", "recordings"])]
    camera: Option<String>,
    /// Control port of the same scanner. If omitted, the page only shows the camera.
    #[arg(long, value_name = "PATH", requires = "camera")]
    control: Option<PathBuf>,
    /// Run directory of an emulated device.
    #[arg(long, value_name = "DIR", conflicts_with = "camera")]
    run_dir: Option<PathBuf>,
    /// Sequence to scan if the page selects none [default: the sequence selected on the device]
    #[arg(long, value_name = "NAME")]
    sequence: Option<String>,
    /// Manifest of the sequence, for a device that does not report it.
    #[arg(long, value_name = "FILE")]
    manifest: Option<PathBuf>,
    /// Calibration file to use instead of the device's own.
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Dialect of the control port: a built-in name or a TOML file [default: that of the
    /// device.json beside the port, else SCPI]
    #[arg(long, value_name = "NAME|FILE")]
    dialect: Option<String>,
    /// Folder of recordings: the page plays them, and stores new and uploaded recordings there.
    /// Needs no scanner.
    #[arg(long, value_name = "DIR")]
    recordings: Option<PathBuf>,
    /// Port of the page on the loopback interface; 0 picks a free one.
    #[arg(long, default_value_t = 0)]
    port: u16,
}

/// # Errors
/// Returns an error if a file is invalid, the camera cannot be opened, or the port is taken.
pub(super) fn run(args: &Args) -> Result<()> {
    interrupt::watch_signals();
    let (camera, control) = match (&args.run_dir, &args.camera) {
        (Some(dir), _) => {
            let at = endpoints_in(dir).map_err(|e| e.at("--run-dir"))?;
            (at.camera_socket, Some(at.control))
        }
        (None, camera) => (camera.clone().unwrap_or_default(), args.control.clone()),
    };
    if let Some(dialect) = &args.dialect {
        Dialect::load(dialect).map_err(|e| e.at("--dialect"))?;
    }
    let manifest = args.manifest.as_deref().map(Manifest::read).transpose();
    let calibration = args.calibration.as_deref().map(read_rig).transpose();
    let options = ScanOptions {
        sequence: args.sequence.clone(),
        manifest: manifest.map_err(|e| e.at("--manifest"))?,
        calibration: calibration.map_err(|e| e.at("--calibration"))?,
        dialect: args.dialect.clone(),
        ..ScanOptions::default()
    };
    let console = Console::start(&ConsoleOptions {
        port: args.port,
        recordings: args.recordings.clone(),
    });
    let console = console.map_err(|e| e.at("--port"))?;
    let source = { !camera.is_empty() }.then(|| console.source(&camera));
    let _playback = match &args.recordings {
        Some(folder) => {
            let known = options.manifest.clone().map(|manifest| Sequence {
                name: options.sequence.clone(),
                manifest,
                calibration: options.calibration,
            });
            let playback = Playback::start(console.playback("recordings"), folder, known);
            Some(playback.map_err(|e| e.at("--recordings"))?)
        }
        None => None,
    };
    let mut announced = false;
    let mut flow = || {
        // This function is called for the first time when the camera, if there is one, is open.
        if !announced {
            announced = true;
            announce(&console);
        }
        interrupt::flow()
    };
    match (source, control) {
        (Some(source), Some(control)) => operate(&source, &camera, &control, &options, flow),
        (Some(source), None) => watch_camera(&camera, CameraDriver::Auto, &source.observer(), flow),
        (None, _) => {
            while flow().is_continue() {
                std::thread::sleep(LOOK);
            }
            Ok(())
        }
    }
}

/// Prints the addresses of the page. If standard output is closed, the console goes on.
fn announce(console: &Console) {
    let mut out = std::io::stdout();
    let text = format!(
        "  control  {}\n  view     {}\nCtrl-C ends it.\n",
        console.url(),
        console.view_url()
    );
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}
