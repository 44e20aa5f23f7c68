//! `phasmid serve`: serves emulated devices.
//!
//! | file | contents |
//! | --- | --- |
//! | `args` | options |
//! | `asked` | resolves the command line into devices and scenes |
//! | `unit` | one device, served on a thread of its own |
//! | `video` | the V4L2 node of `--camera` |
//! | `usb` | the USB devices of `--usb` and their server |
//! | `run_dirs` | the directories with the devices' endpoints |
//! | `console` | the page of `--console`; `without_console` if it is compiled without |
//! | `announce` | messages on standard output |
//! | `shutdown` | signals and `--while-stdin` |

mod announce;
mod args;
mod asked;
#[cfg(feature = "console")]
mod console;
#[cfg(not(feature = "console"))]
#[path = "without_console.rs"]
mod console;
mod run_dirs;
mod shutdown;
mod unit;
mod usb;
mod video;

pub(super) use args::{Args, tcp};
pub(super) use run_dirs::{check_run_dir, default_run_dir, run_parent};
pub(super) use shutdown::Shutdown;
pub(super) use unit::runtime;

use asked::Asked;
use console::Page;
use phasmid_core::error::{Error, Result};
use phasmid_device::link::{RunDir, Serving, SharedScene, Timeline, monotonic};
use phasmid_protocol::faults::Schedule;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};
use tokio::sync::mpsc;
use unit::Unit;

pub(super) fn run(args: &Args) -> Result<()> {
    // Watch for signals before anything else, so that a signal ends the program in the same way at
    // any time.
    let runtime = unit::runtime()?;
    let shutdown = {
        let _inside = runtime.enter();
        Shutdown::watch(args.while_stdin)?
    };
    check_run_dir(args.run_dir.as_deref())?;
    let (mut devices, scenes) = asked::asked(args)?;
    for device in &mut devices {
        device.profile.camera.sensor.noiseless = args.no_noise;
        device.profile.factory_calibration.exact |= args.exact_calibration;
        if let Some(dialect) = &args.dialect {
            // A path on the command line is relative to the working directory, not to the profile.
            super::dialect::speak(&mut device.profile, dialect, "--dialect");
        }
    }
    if args.usb.is_some() {
        usb::check(devices.iter().map(|device| &device.profile))?;
    }
    let schedule = match &args.faults {
        Some(file) => {
            let names: Vec<_> = devices.iter().map(|device| device.name.as_str()).collect();
            Schedule::read_for(file, &names).map_err(|e| e.at("--faults"))?
        }
        None => Schedule::default(),
    };
    let names = devices.iter().map(|device| device.name.as_str());
    let page = Page::start(args, names)?;
    let power = Power::default();
    let on = power.clone();
    let timeline = Timeline::new(args.clock.into(), move || on.elapsed());
    let shared_scenes: Vec<_> = scenes
        .iter()
        .map(|(_, scene)| SharedScene::new(scene))
        .collect();
    let units: Vec<_> = devices
        .iter()
        .enumerate()
        .map(|(index, device)| {
            let shared_scene = shared_scenes[device.scene].clone();
            Unit::new(
                args,
                device,
                &scenes[device.scene],
                (timeline.seat(), shared_scene),
                &schedule,
                page.observer(index),
            )
        })
        .collect::<Result<_>>()?;
    let served = runtime.block_on(serve(args, &devices, units, power, &page, shutdown));
    announce::announce_clock(&timeline.about());
    served
}

/// The time when the devices were switched on.
#[derive(Clone, Default)]
struct Power(Arc<OnceLock<Instant>>);

impl Power {
    fn on(&self) {
        self.0.get_or_init(Instant::now);
    }

    /// Returns the time since power-on; zero before power-on.
    fn elapsed(&self) -> Duration {
        self.0.get().map_or(Duration::ZERO, Instant::elapsed)
    }
}

async fn serve(
    args: &Args,
    devices: &[Asked],
    mut units: Vec<Unit>,
    power: Power,
    page: &Page,
    mut shutdown: Shutdown,
) -> Result<()> {
    if shutdown.has_come().await {
        return Ok(());
    }
    let dirs = run_dirs::run_dirs(args, devices)?;
    let _holder = run_dirs::Holder::make(&dirs, args.run_dir.is_some())?;
    let dirs: Vec<_> = dirs
        .iter()
        .map(|dir| RunDir::claim(dir))
        .collect::<Result<_>>()?;
    power.on();
    let power_on = monotonic();
    let clock = move || power.elapsed();
    for (unit, device) in units.iter_mut().zip(devices) {
        unit.open_video(args, &device.profile, power_on)?;
    }
    if let Some(how) = args.usb {
        let profiles = devices.iter().map(|device| &device.profile);
        let firmware = profiles.zip(units.iter().map(Unit::firmware));
        let links = tokio::select! {
            links = usb::serve_usb(how, args.usb_listen, firmware, clock.clone()) => links?,
            () = shutdown.wait() => return Ok(()),
        };
        for (unit, link) in units.iter_mut().zip(links) {
            unit.set_usb(link);
        }
    }
    if let Some(path) = &args.record {
        let alone = dirs.len() == 1;
        for (unit, dir) in units.iter_mut().zip(&dirs) {
            let path = recording_path(path, dir.path(), alone);
            let inside = real_folder(&path).is_some_and(|folder| {
                dir.path()
                    .canonicalize()
                    .is_ok_and(|dir| folder.starts_with(dir))
            });
            if inside {
                return Err(Error::input(
                    format!("--record {}", path.display()),
                    "a file in the run directory, which is removed with the device",
                    "a file elsewhere",
                ));
            }
            unit.record(&path, args.force)?;
        }
    }
    let units = units.into_iter().zip(dirs).collect();
    supervise(units, clock, page, shutdown).await
}

/// Returns the folder of a file, with links resolved.
fn real_folder(file: &Path) -> Option<PathBuf> {
    let file = std::path::absolute(file).ok()?;
    file.parent()?.canonicalize().ok()
}

/// Returns the recording file of the device with this run directory. Unless it is the only device, the
/// directory's name is added.
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

/// Runs each device on a thread of its own, until a device ends or the program is asked to end.
async fn supervise(
    units: Vec<(Unit, RunDir)>,
    clock: impl Fn() -> Duration + Clone + Send + 'static,
    page: &Page,
    mut shutdown: Shutdown,
) -> Result<()> {
    let (tell, mut ended) = mpsc::unbounded_channel();
    let mut devices = Vec::new();
    for (unit, dir) in units {
        let tell = tell.clone();
        let (serving, about) = unit.start(dir, clock.clone(), move || {
            let _ = tell.send(());
        })?;
        announce::announce(serving.endpoints(), &about);
        page.served(devices.len(), serving.endpoints());
        devices.push(serving);
    }
    announce::announce_end(&page.about());
    tokio::select! {
        () = shutdown.wait() => {}
        _ = ended.recv() => {}
    }
    let ended: Vec<_> = devices.into_iter().map(Serving::stop).collect();
    ended.into_iter().collect()
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
