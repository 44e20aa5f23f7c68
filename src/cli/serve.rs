//! `phasma serve`: puts a device on the desk that is not there.

use crate::emulator::{Clock, Firmware, PacedClock, Renderer, UserSequence, VirtualClock};
use crate::error::{Error, Result};
use crate::link::usb::{Binding, UsbServer, attach};
use crate::link::{Device, RunDir, VideoOutput, serve};
use crate::profile::{Profile, Scene};
use crate::protocol::Endpoints;
use std::io::Write;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::{Duration, Instant};
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::oneshot;

/// Serve an emulated scanner until Ctrl-C or TERM.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Device profile: a built-in name or a TOML file.
    #[arg(long, default_value = "pmp-bench")]
    profile: String,
    /// What stands before it: a built-in name or a TOML file.
    #[arg(long, default_value = "torso")]
    scene: String,
    /// Where its endpoints are kept; a directory of its own under XDG_RUNTIME_DIR or the temporary
    /// directory when absent.
    #[arg(long, value_name = "DIR")]
    run_dir: Option<PathBuf>,
    /// Where frames go besides the frame socket: a node of v4l2loopback by its path (/dev/video10);
    /// auto, the first free one whose label starts with Phasma; or socket, nowhere else.
    #[arg(long, value_name = "ADDR", default_value = "auto")]
    camera: Choice,
    /// Be a USB device too, camera and serial port in one: export lets hosts take it over USB/IP
    /// (`usbip attach`), attach also hands it to this machine's own kernel.
    #[arg(long, value_name = "HOW", value_enum, num_args = 0..=1, default_missing_value = "export")]
    usb: Option<UsbHow>,
    /// Where to export the USB device. USB/IP has no authentication: whoever reaches the address
    /// can take the device.
    #[arg(
        long,
        value_name = "IP:PORT",
        default_value = "127.0.0.1:3240",
        requires = "usb"
    )]
    usb_listen: SocketAddr,
    /// Seed of the noise.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Leave the noise out.
    #[arg(long)]
    no_noise: bool,
    /// Serve frames on this port of the loopback interface too; 0 picks a free one.
    #[arg(long, value_name = "PORT")]
    tcp: Option<u16>,
    /// Load a sequence of your own: a manifest whose pictures stand beside it. May be repeated.
    #[arg(long, value_name = "FILE")]
    sequence: Vec<PathBuf>,
    /// End when standard input does: for programs that start a device and may be killed.
    #[arg(long)]
    while_stdin: bool,
    /// How device time passes.
    #[arg(long, value_enum, default_value_t = Pace::Real)]
    clock: Pace,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum UsbHow {
    /// For `usbip attach`, here or elsewhere.
    Export,
    /// To this machine's own kernel as well.
    Attach,
}

/// `--camera`.
#[derive(Debug, Clone)]
enum Choice {
    Auto,
    Socket,
    Node(PathBuf),
}

impl FromStr for Choice {
    type Err = &'static str;

    fn from_str(text: &str) -> std::result::Result<Self, Self::Err> {
        match text {
            "auto" => Ok(Self::Auto),
            "socket" => Ok(Self::Socket),
            path if path.starts_with("/dev/") => Ok(Self::Node(path.into())),
            _ => Err("allowed: auto, socket or a path such as /dev/video10"),
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Pace {
    /// As on the wall.
    Real,
    /// It jumps to what happens next.
    Fast,
}

pub(super) fn run(args: &Args) -> Result<()> {
    if let (Choice::Node(path), Pace::Fast) = (&args.camera, args.clock) {
        return Err(Error::input(
            "--clock fast",
            format!("with --camera {}", path.display()),
            "--clock real: a V4L2 reader cannot hold the device up, so frames would be lost; or \
             --camera socket",
        ));
    }
    let mut profile = Profile::load(&args.profile)?;
    profile.camera.sensor.noiseless = args.no_noise;
    let scene = Scene::load(&args.scene)?;
    let user: Vec<_> = args
        .sequence
        .iter()
        .map(|path| UserSequence::read(path))
        .collect::<Result<_>>()?;
    let clock: Box<dyn Clock> = match args.clock {
        Pace::Real => Box::new(PacedClock),
        Pace::Fast => Box::new(VirtualClock::default()),
    };
    let id = &profile.identity;
    let mut device = Device {
        firmware: Firmware::new(&profile, &user)?,
        renderer: Renderer::new(&profile, &scene, args.seed)?,
        clock,
        name: format!(
            "{},{},{},{}",
            id.manufacturer, id.model, id.serial, id.firmware
        ),
        profile: args.profile.clone(),
        scene: args.scene.clone(),
        seed: args.seed,
        tcp: args.tcp,
        video: None,
        usb: None,
        notice: |text| eprintln!("phasma: {text}"),
    };
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(|e| Error::io("event loop", e))?;
    runtime.block_on(async {
        // Before anything is made that would have to be removed.
        let signal = |kind| signal(kind).map_err(|e| Error::io("signals", e));
        let mut interrupt = signal(SignalKind::interrupt())?;
        let mut terminate = signal(SignalKind::terminate())?;
        // A terminal that is closed.
        let mut hang_up = signal(SignalKind::hangup())?;
        let parent = args.while_stdin.then(end_of_input);
        let run_dir = match &args.run_dir {
            // device.json is read from anywhere.
            Some(dir) => std::path::absolute(dir).map_err(|e| Error::io(dir, e))?,
            None => default_run_dir(&profile.name),
        };
        let run_dir = RunDir::claim(&run_dir)?;
        let shutdown = async move {
            tokio::select! {
                _ = interrupt.recv() => {}
                _ = terminate.recv() => {}
                _ = hang_up.recv() => {}
                () = gone(parent) => {}
            }
        };
        let start = Instant::now();
        let power_on = monotonic();
        let bits = profile.camera.sensor.bits;
        let (video, why) = open_video(args, &device.firmware, bits, power_on)?;
        device.video = video;
        let clock = move || start.elapsed();
        let mut why = why;
        if let Some(how) = args.usb {
            let (usb, words) = open_usb(args, how, &profile, &device.firmware, clock).await?;
            device.usb = Some(usb);
            why = words;
        }
        let announce = |endpoints: &Endpoints| announce(endpoints, &why);
        serve(device, run_dir, clock, announce, shutdown).await
    })
}

/// The USB device that was asked for, with its address, and what to say of it.
async fn open_usb(
    args: &Args,
    how: UsbHow,
    profile: &Profile,
    firmware: &Firmware,
    clock: impl Fn() -> Duration + Clone + Send + Sync + 'static,
) -> Result<((Binding, String), String)> {
    let binding = Binding::new(profile, firmware, 1)?;
    let device = binding.device().clone();
    let bus_id = device.info().bus_id.clone();
    let server = UsbServer::bind(args.usb_listen, vec![device.clone()]).await?;
    let listen = server.address().unwrap_or(args.usb_listen);
    if !listen.ip().is_loopback() {
        eprintln!(
            "phasma: USB/IP has no authentication: whoever reaches {listen} can take the device"
        );
    }
    let mut words = format!("export it elsewhere with usbip attach -r HOST -b {bus_id}");
    if how == UsbHow::Attach {
        let attachment = attach(device)?;
        words = "attached to this machine's kernel".to_owned();
        let clock = clock.clone();
        tokio::spawn(async move {
            // The kernel lets go, or breaks off: the device can be taken again either way.
            let _ = attachment.run(clock).await;
        });
    }
    tokio::spawn(server.run(clock));
    Ok(((binding, format!("usb:{listen}/{bus_id}")), words))
}

/// The V4L2 node that was asked for or found, and what to say of the camera.
fn open_video(
    args: &Args,
    firmware: &Firmware,
    bits: u32,
    power_on: Duration,
) -> Result<(Option<VideoOutput>, String)> {
    let stream = firmware.stream();
    let opened = match &args.camera {
        Choice::Socket => return Ok((None, String::new())),
        // The camera is the USB device's.
        Choice::Auto if args.usb.is_some() => return Ok((None, String::new())),
        Choice::Node(path) => Ok(VideoOutput::open(path, &stream, bits, power_on)?),
        Choice::Auto if args.clock == Pace::Fast => Err("--clock fast: a V4L2 reader cannot hold \
             the device up, so frames would be lost"
            .to_owned()),
        Choice::Auto => VideoOutput::open_any(&stream, bits, power_on)
            .map_err(|why| format!("{why}; run phasma doctor")),
    };
    Ok(match opened {
        Ok(video) => {
            let about = video.about();
            (Some(video), about)
        }
        Err(why) => (None, why),
    })
}

/// The time that V4L2 stamps frames with.
fn monotonic() -> Duration {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    let seconds = u64::try_from(now.tv_sec).unwrap_or(0);
    Duration::from_secs(seconds) + Duration::from_nanos(now.tv_nsec.unsigned_abs())
}

/// Tells when standard input has ended: whoever held its other end is gone, even by KILL.
fn end_of_input() -> oneshot::Receiver<()> {
    let (ended, wait) = oneshot::channel();
    std::thread::spawn(move || {
        // What is written there is nobody's concern; an error is an end too.
        let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
        let _ = ended.send(());
    });
    wait
}

async fn gone(parent: Option<oneshot::Receiver<()>>) {
    match parent {
        // The thread sends, or dies: both are the end.
        Some(wait) => drop(wait.await),
        None => std::future::pending().await,
    }
}

/// One directory a profile: `$XDG_RUNTIME_DIR/phasma-NAME`, or `/tmp/phasma-UID-NAME`.
fn default_run_dir(profile: &str) -> PathBuf {
    match runtime_dir() {
        Some(dir) => dir.join(format!("phasma-{profile}")),
        None => {
            let user = rustix::process::geteuid().as_raw();
            std::env::temp_dir().join(format!("phasma-{user}-{profile}"))
        }
    }
}

/// Where run directories are made.
pub(super) fn run_parent() -> PathBuf {
    runtime_dir().unwrap_or_else(std::env::temp_dir)
}

fn runtime_dir() -> Option<PathBuf> {
    let dir = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    dir.filter(|dir| dir.is_absolute() && dir.is_dir())
}

/// `about` says what the camera is, or why it is no other.
fn announce(endpoints: &Endpoints, about: &str) {
    let mut text = format!(
        "{} looking at {}\n  control  {}\n  camera   {}",
        endpoints.profile,
        endpoints.scene,
        endpoints.control.display(),
        endpoints.camera
    );
    if !about.is_empty() {
        text += &format!(" ({about})");
    }
    text.push('\n');
    if endpoints.camera_socket != endpoints.camera {
        text += &format!("           {}\n", endpoints.camera_socket);
    }
    if let Some(tcp) = &endpoints.camera_tcp {
        text += &format!("           {tcp}\n");
    }
    text += &format!(
        "  service  {}\nCtrl-C ends it.\n",
        endpoints.service.display()
    );
    // A closed standard output is no reason to stop serving.
    let mut out = std::io::stdout();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}
