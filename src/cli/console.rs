//! `phasmid console`: a page in the browser that shows what a camera sees.

use super::interrupt;
use crate::facade::{endpoints_in, watch_camera};
use phasmid_console::{Console, ConsoleOptions};
use phasmid_core::error::Result;
use phasmid_host::CameraDriver;
use std::io::Write;
use std::path::PathBuf;

/// Show a camera in the browser, until Ctrl-C
///
/// Opens the camera, emulated or physical, and prints the address of a page that shows its frames. Its
/// control port is left alone. To see a device beside another program, use `phasmid serve --console`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  phasmid console --run-dir run\n  phasmid console --camera /dev/video0"
)]
pub(super) struct Args {
    /// Camera: /dev/videoN, socket:PATH or tcp:HOST:PORT.
    #[arg(long, value_name = "ADDR", required_unless_present = "run_dir")]
    camera: Option<String>,
    /// Run directory of an emulated device, whose camera is shown.
    #[arg(long, value_name = "DIR", conflicts_with = "camera")]
    run_dir: Option<PathBuf>,
    /// Port of the page on the loopback interface; 0 picks a free one.
    #[arg(long, default_value_t = 0)]
    port: u16,
}

/// # Errors
/// Returns an error if the camera cannot be opened, or if the port is taken.
pub(super) fn run(args: &Args) -> Result<()> {
    interrupt::watch_signals();
    let camera = match (&args.run_dir, &args.camera) {
        (Some(dir), _) => {
            endpoints_in(dir)
                .map_err(|e| e.at("--run-dir"))?
                .camera_socket
        }
        (None, camera) => camera.clone().unwrap_or_default(),
    };
    let options = ConsoleOptions { port: args.port };
    let console = Console::start(&options).map_err(|e| e.at("--port"))?;
    let observer = console.source(&camera).observer();
    let mut announced = false;
    watch_camera(&camera, CameraDriver::Auto, &observer, || {
        // Once the camera has been opened.
        if !announced {
            announced = true;
            announce(&console);
        }
        interrupt::flow()
    })
}

/// Prints the addresses of the page. The console also goes on if standard output is closed.
fn announce(console: &Console) {
    let mut out = std::io::stdout();
    let text = format!(
        "  control  {}\n  view     {}\nCtrl-C ends it.\n",
        console.url(),
        console.view_url()
    );
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}
