//! Options of `phasmid serve`.

use super::usb::{UsbHow, listen_address};
use crate::cli::options::{BackendArg, SetArgs};
use phasmid_core::error::Result;
use phasmid_device::link::Tcp;
use phasmid_protocol::admission::Token;
use phasmid_protocol::service::ClockPace;
use phasmid_render::Options;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Serve one or several emulated scanners until Ctrl-C or TERM.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  phasmid serve --profile webcam-grey --scene sphere --run-dir run"
)]
pub(crate) struct Args {
    /// Device profile, or a station, which lists several devices: a built-in name or a TOML file.
    /// Repeat to serve several.
    #[arg(long, default_value = "pmp-bench")]
    pub(super) profile: Vec<String>,
    /// Scene in front of the devices: a built-in name or a TOML file [default: the station's, else
    /// torso]. Given once, all devices share it; else repeat it once per device.
    #[arg(long)]
    pub(super) scene: Vec<String>,
    #[command(flatten)]
    pub(super) set: SetArgs,
    /// Directory for the endpoints [default: one per device under XDG_RUNTIME_DIR or the temporary
    /// directory]. Each of several devices has a directory in it, with its name in the station or its
    /// profile's.
    #[arg(long, value_name = "DIR")]
    pub(super) run_dir: Option<PathBuf>,
    /// Where frames go besides the frame socket: the path of a v4l2loopback node (/dev/video10); auto,
    /// the first free node whose label starts with Phasmid; or socket, the frame socket only.
    #[arg(long, value_name = "ADDR", default_value = "auto")]
    pub(super) camera: CameraChoice,
    /// Also serve a USB device with camera and serial port: export lets hosts attach it over USB/IP
    /// (`usbip attach`); attach also attaches it to this machine's own kernel.
    #[arg(long, value_name = "HOW", value_enum, num_args = 0..=1, default_missing_value = "export")]
    pub(super) usb: Option<UsbHow>,
    /// Address at which to export the USB device. USB/IP has no authentication: any host that
    /// reaches the address can attach the device.
    #[arg(
        long,
        value_name = "IP:PORT",
        default_value = "127.0.0.1:3240",
        value_parser = listen_address,
        requires = "usb"
    )]
    pub(super) usb_listen: SocketAddr,
    /// Dialect of the control port instead of the profile's: a built-in name or a TOML file.
    #[arg(long, value_name = "NAME")]
    pub(super) dialect: Option<String>,
    /// Seed of the first device's noise; each further device uses the next number.
    #[arg(long, default_value_t = 0)]
    pub(super) seed: u64,
    /// Rays per pixel: 1, 4, 16 or 64. More rays resolve details thinner than a pixel and take
    /// proportionally longer, once per scene.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(super) samples: u32,
    /// Instants per exposure at which a moving scene is rendered, 1 to 256; each takes as long as
    /// rendering a static scene once.
    #[arg(long, value_name = "N", default_value_t = 4)]
    pub(super) time_samples: u32,
    /// Maximum error in projector pixels, 0 to 1, of geometry that is interpolated between instants
    /// of a moving scene; 0 computes the geometry at every instant.
    #[arg(long, value_name = "PX", default_value_t = Options::default().motion_tolerance_px)]
    pub(super) motion_tolerance: f64,
    /// Where the render passes run.
    #[arg(long, value_enum, default_value_t = BackendArg::Cpu)]
    pub(super) backend: BackendArg,
    /// Render without sensor noise.
    #[arg(long)]
    pub(super) no_noise: bool,
    /// Let the device report its exact rig instead of a factory calibration with errors
    #[arg(long)]
    pub(super) exact_calibration: bool,
    /// Also serve frames on this TCP port of the loopback interface; 0 picks a free one. TCP is not
    /// authenticated: without --tcp-token, every user of this machine can read the frames.
    #[arg(long, value_name = "PORT")]
    pub(super) tcp: Option<u16>,
    /// File with a token that TCP clients must present: one line of at least 16 characters.
    /// `phasmid` commands find it through the environment variable PHASMID_TCP_TOKEN_FILE.
    #[arg(long, value_name = "FILE", requires = "tcp")]
    pub(super) tcp_token: Option<PathBuf>,
    /// Load a sequence of your own: a manifest with its images in the same folder. May be repeated.
    #[arg(long, value_name = "FILE")]
    pub(super) sequence: Vec<PathBuf>,
    /// Schedule of faults to inject, see `phasmid faults list`. A fault may be limited to one of
    /// several devices, by its name in the station or its profile's.
    #[arg(long, value_name = "FILE")]
    pub(super) faults: Option<PathBuf>,
    /// Also serve a page for the browser that shows the devices working, on this port of the loopback
    /// interface; without a port, on a free one. Prints one address to control and one to view.
    #[arg(long, value_name = "PORT", num_args = 0..=1, require_equals = true, default_missing_value = "0")]
    pub(super) console: Option<u16>,
    /// Folder of recordings: the page plays them, and stores new and uploaded recordings there.
    #[arg(long, value_name = "DIR", requires = "console")]
    pub(super) recordings: Option<PathBuf>,
    /// Exit when standard input closes, for programs that start a device and may be killed.
    #[arg(long)]
    pub(super) while_stdin: bool,
    /// Pace of the device time that all devices share.
    #[arg(long, value_enum, default_value_t = Pace::Real)]
    pub(super) clock: Pace,
    /// Record every byte and frame with its time, for `phasmid replay` and `phasmid record info`. Each
    /// of several devices has a file of its own, with its directory's name added to the file's.
    #[arg(long, value_name = "FILE")]
    pub(super) record: Option<PathBuf>,
    /// Overwrite the file of --record.
    #[arg(long, requires = "record")]
    pub(super) force: bool,
}

/// Values of `--camera`.
#[derive(Debug, Clone)]
pub(super) enum CameraChoice {
    Auto,
    Socket,
    Node(PathBuf),
}

impl FromStr for CameraChoice {
    type Err = &'static str;

    fn from_str(text: &str) -> std::result::Result<Self, Self::Err> {
        match text {
            "auto" => Ok(Self::Auto),
            "socket" => Ok(Self::Socket),
            path if path.starts_with("/dev/") => Ok(Self::Node(path.into())),
            _ => Err("expected auto, socket or a path such as /dev/video10"),
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Pace {
    /// In real time.
    Real,
    /// Jumps to the next event.
    Fast,
    /// Advances on requests over the service channel.
    Stepped,
}

impl From<Pace> for ClockPace {
    fn from(pace: Pace) -> Self {
        match pace {
            Pace::Real => Self::Real,
            Pace::Fast => Self::Fast,
            Pace::Stepped => Self::Stepped,
        }
    }
}

/// Returns the TCP port and token for serving frames, from the options `--tcp` and `--tcp-token`.
///
/// # Errors
/// Returns an error if the file holds no token.
pub(crate) fn tcp(port: Option<u16>, token: Option<&Path>) -> Result<Option<Tcp>> {
    let token = token.map(Token::read).transpose();
    let token = token.map_err(|e| e.at("--tcp-token"))?;
    Ok(port.map(|port| Tcp { port, token }))
}
