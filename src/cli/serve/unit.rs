//! One of the served devices.

use super::Args;
use super::asked::Asked;
use super::video::open_video;
use crate::cli::dialect;
use crate::cli::record::unix_s;
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file::stream;
use phasmid_device::faults::Faults;
use phasmid_device::link::{Device, Recording, RunDir, Seat, SharedScene, UsbLink, serve};
use phasmid_device::{Firmware, Machine, SerialLine, UserSequence};
use phasmid_profile::{Profile, Scene};
use phasmid_protocol::Endpoints;
use phasmid_protocol::faults::Schedule;
use phasmid_render::Options;
use phasmid_render::Renderer;
use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tokio::sync::{mpsc, watch};

/// A device that is prepared to be served.
pub(super) struct Unit {
    device: Device,
    /// Describes the camera, or says why it is not a V4L2 node.
    about: String,
    /// The file of its recording, if that was created for it.
    made: Option<Made>,
}

/// A file that was created for a device. It is removed if the device never becomes reachable.
struct Made {
    path: PathBuf,
    kept: Cell<bool>,
}

impl Drop for Made {
    fn drop(&mut self) {
        if !self.kept.get() {
            // Best effort: the reported error is the reason why the device did not start.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Events of the devices.
pub(super) enum News {
    /// The device with this index is reachable.
    Ready(usize, Box<Endpoints>),
    /// A device has ended.
    Ended(Result<()>),
}

impl Unit {
    /// Prepares a requested device with its scene, its access to the shared timeline and scene, and
    /// the faults that apply to it.
    pub(super) fn new(
        args: &Args,
        asked: &Asked,
        (label, scene): &(String, Scene),
        (seat, shared_scene): (Seat, SharedScene),
        schedule: &Schedule,
    ) -> Result<Self> {
        let profile = &asked.profile;
        let tcp = super::tcp(args.tcp, args.tcp_token.as_deref())?;
        let user: Vec<_> = args
            .sequence
            .iter()
            .map(|path| UserSequence::read(path).map_err(|e| e.at("--sequence")))
            .collect::<Result<_>>()?;
        let id = &profile.identity;
        let mut scene = scene.clone();
        scene.rig = asked.rig.unwrap_or(scene.rig);
        let options = Options {
            samples: args.samples,
            time_samples: args.time_samples,
            backend: args.backend.into(),
        };
        let mut renderer = Renderer::with_options(profile, &scene, asked.seed, options)?;
        if let Some(news) = renderer.news()? {
            eprintln!("phasmid: {}: {news}", asked.label);
        }
        if let Some(adapter) = renderer.adapter() {
            let (name, kind, driver) = (&adapter.name, adapter.kind, &adapter.driver);
            let profile = &asked.label;
            eprintln!("phasmid: {profile}: rendering on a GPU, {kind}: {name} ({driver})");
        }
        let port = dialect::port(profile)?;
        let firmware = Firmware::new(profile, &user)?;
        if let Err(why) = firmware.factory_calibration() {
            eprintln!("phasmid: {why}; CALibration:DATA? answers with an error");
        }
        let device = Device {
            machine: Machine::new(
                firmware,
                port,
                SerialLine::new(&profile.control),
                Faults::new(schedule, &asked.name)
                    .of_rows(profile.camera.height_px)
                    .map_err(|flaw| Error::input(flaw.field, flaw.found, flaw.allowed))?,
            ),
            renderer,
            seat,
            shared_scene,
            rig: scene.rig,
            name: format!(
                "{},{},{},{}",
                id.manufacturer, id.model, id.serial, id.firmware
            ),
            profile: asked.label.clone(),
            scene: label.clone(),
            seed: asked.seed,
            dialect: dialect::from_anywhere(&profile.control.dialect_path(&profile.folder)),
            baud: profile.control.baud,
            tcp,
            video: None,
            usb: None,
            recording: None,
            notice: |text| eprintln!("phasmid: {text}"),
        };
        Ok(Self {
            device,
            about: String::new(),
            made: None,
        })
    }

    /// Opens the V4L2 node for it. `power_on` is the system's monotonic time at power-on.
    pub(super) fn open_video(
        &mut self,
        args: &Args,
        profile: &Profile,
        power_on: Duration,
    ) -> Result<()> {
        let bits = profile.camera.sensor.bits;
        (self.device.video, self.about) =
            open_video(args, self.device.machine.firmware(), bits, power_on)?;
        Ok(())
    }

    pub(super) fn firmware(&self) -> &Firmware {
        self.device.machine.firmware()
    }

    /// Sets its USB link, and the description of that.
    pub(super) fn set_usb(&mut self, (link, about): (UsbLink, String)) {
        self.device.usb = Some(link);
        self.about = about;
    }

    /// Creates the file of its recording.
    ///
    /// # Errors
    /// Returns an error if the file exists without `force`, or cannot be created.
    pub(super) fn record(&mut self, path: &Path, force: bool) -> Result<()> {
        let there = path.symlink_metadata().is_ok();
        let file = stream(path, force).map_err(|e| e.at("--record"))?;
        self.made = (!there).then(|| Made {
            path: path.to_owned(),
            kept: Cell::new(false),
        });
        self.device.recording = Some(Recording {
            file,
            path: path.to_owned(),
            started_unix_s: unix_s(),
        });
        Ok(())
    }

    pub(super) fn about(&self) -> &str {
        &self.about
    }

    /// Serves it from a directory, on a thread of its own, until `stop` becomes true.
    ///
    /// # Errors
    /// Returns an error if the thread cannot be started.
    pub(super) fn start(
        self,
        number: usize,
        run_dir: RunDir,
        wall: impl Fn() -> Duration + Clone + Send + 'static,
        mut stop: watch::Receiver<bool>,
        tell: mpsc::UnboundedSender<News>,
    ) -> Result<()> {
        let body = move || {
            let mut ending = Ending {
                tell: tell.clone(),
                outcome: None,
            };
            let Self { device, made, .. } = self;
            let ready = |endpoints: &Endpoints| {
                if let Some(made) = &made {
                    made.kept.set(true);
                }
                let _ = tell.send(News::Ready(number, Box::new(endpoints.clone())));
            };
            let stopped = async {
                // A dropped sender also ends the device.
                let _ = stop.wait_for(|&stop| stop).await;
            };
            ending.outcome = Some(runtime().and_then(|runtime| {
                runtime.block_on(serve(device, run_dir, wall, ready, stopped))
            }));
        };
        let thread = std::thread::Builder::new().name(format!("device {}", number + 1));
        thread.spawn(body).map_err(|e| Error::io("device", e))?;
        Ok(())
    }
}

/// Reports how a device has ended, even if its thread panics.
struct Ending {
    tell: mpsc::UnboundedSender<News>,
    outcome: Option<Result<()>>,
}

impl Drop for Ending {
    fn drop(&mut self) {
        let died = || Err(Error::device("the thread of a device panicked"));
        let outcome = self.outcome.take().unwrap_or_else(died);
        // The receiver is gone if the whole program ends.
        let _ = self.tell.send(News::Ended(outcome));
    }
}

/// Makes an event loop for the calling thread.
pub(in crate::cli) fn runtime() -> Result<tokio::runtime::Runtime> {
    tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(|e| Error::io("event loop", e))
}
