//! `phasma serve`: puts devices on the desk that are not there.

mod announce;
mod run_dirs;
mod shutdown;
mod unit;
mod usb;
mod video;

pub(super) use run_dirs::{default_run_dir, run_parent};
pub(super) use shutdown::Shutdown;
pub(super) use unit::runtime;

use super::backend::Choice;
use crate::error::{Error, Result};
use crate::link::RunDir;
use crate::profile::{Profile, Scene};
use crate::protocol::dialect::Dialect;
use std::ffi::OsStr;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tokio::sync::{mpsc, watch};
use unit::{News, Unit};
use usb::UsbHow;

/// Devices of one server; hosts have 127 on a bus.
const MAX_DEVICES: usize = 64;

/// Serve an emulated scanner, or several, until Ctrl-C or TERM.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Device profile: a built-in name or a TOML file. Repeated, it serves a device each.
    #[arg(long, default_value = "pmp-bench")]
    profile: Vec<String>,
    /// What stands before it: a built-in name or a TOML file. Of several devices one for all, or
    /// repeated, one each.
    #[arg(long, default_value = "torso")]
    scene: Vec<String>,
    /// Where its endpoints are kept; a directory of its own under XDG_RUNTIME_DIR or the temporary
    /// directory when absent. Of several devices each has a directory in it, named by its profile.
    #[arg(long, value_name = "DIR")]
    run_dir: Option<PathBuf>,
    /// Where frames go besides the frame socket: a node of v4l2loopback by its path (/dev/video10);
    /// auto, the first free one whose label starts with Phasma; or socket, nowhere else.
    #[arg(long, value_name = "ADDR", default_value = "auto")]
    camera: video::Choice,
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
        value_parser = usb::listen_address,
        requires = "usb"
    )]
    usb_listen: SocketAddr,
    /// The dialect of the control port, instead of the profile's: a built-in name or a TOML file.
    #[arg(long, value_name = "NAME")]
    dialect: Option<String>,
    /// Seed of the noise; of several devices the first one's, and one more for each that follows.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Rays a pixel: 1, 4, 16 or 64. More catch what is thinner than a pixel, and take as many times
    /// as long, once for each scene.
    #[arg(long, value_name = "N", default_value_t = 1)]
    samples: u32,
    /// Instants of an exposure at which a scene that moves is looked at, 1 to 256: each takes as long
    /// as a still scene takes once.
    #[arg(long, value_name = "N", default_value_t = 4)]
    time_samples: u32,
    /// What runs the passes of the rendering.
    #[arg(long, value_enum, default_value_t = Choice::Cpu)]
    backend: Choice,
    /// Leave the noise out.
    #[arg(long)]
    no_noise: bool,
    /// Serve frames on this port of the loopback interface too; 0 picks a free one.
    #[arg(long, value_name = "PORT")]
    tcp: Option<u16>,
    /// Load a sequence of your own: a manifest whose pictures stand beside it. May be repeated.
    #[arg(long, value_name = "FILE")]
    sequence: Vec<PathBuf>,
    /// What goes wrong, and when: a schedule of faults, see `phasma faults list`. A fault may be for
    /// one device of several, by its profile's name.
    #[arg(long, value_name = "FILE")]
    faults: Option<PathBuf>,
    /// End when standard input does: for programs that start a device and may be killed.
    #[arg(long)]
    while_stdin: bool,
    /// How device time passes.
    #[arg(long, value_enum, default_value_t = Pace::Real)]
    clock: Pace,
    /// Record every byte and frame with its time, for phasma replay and phasma record info. Of
    /// several devices each has a file, with its directory's name behind the file's.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Overwrite the file of --record.
    #[arg(long, requires = "record")]
    force: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Pace {
    /// As on the wall.
    Real,
    /// It jumps to what happens next.
    Fast,
}

pub(super) fn run(args: &Args) -> Result<()> {
    check(args)?;
    let mut profiles: Vec<_> = args
        .profile
        .iter()
        .map(|name| Profile::load(name))
        .collect::<Result<_>>()?;
    for profile in &mut profiles {
        profile.camera.sensor.noiseless = args.no_noise;
        if let Some(dialect) = &args.dialect {
            // A path of the command line is relative to where it was given, not to the profile.
            profile.control.dialect = from_here(dialect);
        }
    }
    if args.usb.is_some() {
        usb::check(&profiles)?;
    }
    let scenes: Vec<_> = args
        .scene
        .iter()
        .map(|name| Scene::load(name))
        .collect::<Result<_>>()?;
    let units: Vec<_> = profiles
        .iter()
        .enumerate()
        .map(|(number, profile)| Unit::new(args, number, profile, &scenes[number % scenes.len()]))
        .collect::<Result<_>>()?;
    let runtime = unit::runtime()?;
    runtime.block_on(serve(args, &profiles, units))
}

/// A path that means the same wherever it is taken from; a name stays what it is.
fn from_here(name_or_path: &str) -> String {
    let absolute = std::path::absolute(name_or_path)
        .ok()
        .filter(|path| path.is_file() && !Dialect::names().any(|name| name == name_or_path));
    absolute
        .and_then(|path| path.to_str().map(str::to_owned))
        .unwrap_or_else(|| name_or_path.to_owned())
}

/// Refuses options that do not go together.
fn check(args: &Args) -> Result<()> {
    let (devices, scenes) = (args.profile.len(), args.scene.len());
    if devices > MAX_DEVICES {
        let allowed = format!("up to {MAX_DEVICES} devices");
        return Err(Error::input(
            "--profile",
            format!("{devices} of them"),
            allowed,
        ));
    }
    if scenes != 1 && scenes != devices {
        return Err(Error::input(
            "--scene",
            format!("{scenes} of them for {devices} devices"),
            "one for all, or one for each --profile",
        ));
    }
    if let Some(port) = args.tcp.filter(|&port| port != 0 && devices > 1) {
        return Err(Error::input(
            format!("--tcp {port}"),
            format!("one port for {devices} devices"),
            "--tcp 0, a free port for each",
        ));
    }
    video::check(args)
}

async fn serve(args: &Args, profiles: &[Profile], mut units: Vec<Unit>) -> Result<()> {
    // Before anything is made that would have to be removed.
    let mut shutdown = Shutdown::watch(args.while_stdin)?;
    let dirs = run_dirs::run_dirs(args, profiles)?;
    let _holder = run_dirs::Holder::make(&dirs, args.run_dir.is_some())?;
    let dirs: Vec<_> = dirs
        .iter()
        .map(|dir| RunDir::claim(dir))
        .collect::<Result<_>>()?;
    let start = Instant::now();
    let power_on = video::monotonic();
    let clock = move || start.elapsed();
    for (unit, profile) in units.iter_mut().zip(profiles) {
        unit.open_video(args, profile, power_on)?;
    }
    if let Some(how) = args.usb {
        let devices = profiles.iter().zip(units.iter().map(Unit::firmware));
        let links = tokio::select! {
            links = usb::serve_usb(how, args.usb_listen, devices, clock) => links?,
            () = shutdown.wait() => return Ok(()),
        };
        for (unit, link) in units.iter_mut().zip(links) {
            unit.set_usb(link);
        }
    }
    if let Some(path) = &args.record {
        let alone = dirs.len() == 1;
        for (unit, dir) in units.iter_mut().zip(&dirs) {
            unit.record(&recording_path(path, dir.path(), alone), args.force)?;
        }
    }
    let units = units.into_iter().zip(dirs).collect();
    supervise(units, clock, shutdown).await
}

/// The file for the recording of a device with this directory.
fn recording_path(path: &Path, dir: &Path, alone: bool) -> PathBuf {
    let part = |part: Option<&OsStr>| part.unwrap_or_default().to_owned();
    if alone {
        return path.to_owned();
    }
    let mut name = part(path.file_stem());
    name.push("-");
    name.push(part(dir.file_name()));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// Runs the devices, each on a thread of its own, until the first of them fails or all are to end.
async fn supervise(
    units: Vec<(Unit, RunDir)>,
    clock: impl Fn() -> Duration + Clone + Send + 'static,
    mut shutdown: Shutdown,
) -> Result<()> {
    let (stop, _) = watch::channel(false);
    let (tell, mut news) = mpsc::unbounded_channel();
    let about: Vec<String> = units
        .iter()
        .map(|(unit, _)| unit.about().to_owned())
        .collect();
    let mut result = Ok(());
    let mut running = 0;
    for (number, (unit, dir)) in units.into_iter().enumerate() {
        result = unit.start(number, dir, clock.clone(), stop.subscribe(), tell.clone());
        if result.is_err() {
            stop.send_replace(true);
            break;
        }
        running += 1;
    }
    let mut shutdown = std::pin::pin!(shutdown.wait());
    let mut silent = running;
    while running > 0 {
        let stopping = *stop.borrow();
        tokio::select! {
            () = &mut shutdown, if !stopping => {
                stop.send_replace(true);
            }
            what = news.recv() => match what.expect("its sender is here") {
                News::Ready(number, endpoints) => {
                    announce::announce(&endpoints, &about[number]);
                    silent -= 1;
                    if silent == 0 {
                        announce::announce_end();
                    }
                }
                News::Ended(outcome) => {
                    running -= 1;
                    stop.send_replace(true);
                    result = result.and(outcome);
                }
            },
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn several_devices_have_a_recording_each() {
        let path = |file: &str, alone| recording_path(file.as_ref(), "run/cam-2".as_ref(), alone);
        assert_eq!(path("a/b.rec", true), Path::new("a/b.rec"));
        assert_eq!(path("a/b.rec", false), Path::new("a/b-cam-2.rec"));
        assert_eq!(path("b", false), Path::new("b-cam-2"));
    }
}
