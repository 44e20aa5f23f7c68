//! One of the served devices.

use super::args::{Args, tcp};
use super::asked::Asked;
use super::video::open_video;
use crate::cli::output::{printed, tell};
use crate::cli::record::unix_s;
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file::stream;
use phasmid_device::link::{Recording, RunDir, Seat, ServedDevice, Serving, SharedScene, UsbLink};
use phasmid_device::{Device, Firmware, UserSequence};
use phasmid_profile::{Profile, Scene};
use phasmid_protocol::faults::Schedule;
use phasmid_protocol::record::Observer;
use phasmid_render::Options;
use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A device that is prepared to be served.
pub(super) struct Unit {
    served: ServedDevice,
    /// Describes the camera, or says why it is not a V4L2 node.
    about: String,
    /// The recording file, if it was created for this device.
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
            // Ignore an error here: the error that is reported is the reason why the device did not
            // start.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

impl Unit {
    /// Prepares a requested device with its scene, its access to the shared timeline and scene, and
    /// the faults that apply to it. `observer` sees the device's traffic.
    pub(super) fn new(
        args: &Args,
        asked: &Asked,
        (label, scene): &(String, Scene),
        (seat, shared_scene): (Seat, SharedScene),
        schedule: &Schedule,
        observer: Option<Observer>,
    ) -> Result<Self> {
        let profile = &asked.profile;
        let tcp = tcp(args.tcp, args.tcp_token.as_deref())?;
        let user: Vec<_> = args
            .sequence
            .iter()
            .map(|path| UserSequence::read(path).map_err(|e| e.at("--sequence")))
            .collect::<Result<_>>()?;
        let mut scene = scene.clone();
        scene.rig = asked.rig.unwrap_or(scene.rig);
        let options = Options {
            samples: args.samples,
            time_samples: args.time_samples,
            motion_tolerance_px: args.motion_tolerance,
            backend: args.backend.into(),
        };
        let mut device = Device::builder(profile, &scene)
            .name(&asked.name)
            .seed(asked.seed)
            .options(options)
            .sequences(user)
            .faults(schedule)
            .build()?;
        tell(&asked.label, &mut device)?;
        let served = ServedDevice {
            label: asked.name.clone(),
            profile: asked.label.clone(),
            scene: label.clone(),
            tcp,
            observer,
            notice: printed(),
            ..ServedDevice::new(device, seat, shared_scene)
        };
        Ok(Self {
            served,
            about: String::new(),
            made: None,
        })
    }

    /// Opens the V4L2 node of the device. `power_on` is the system's monotonic time at power-on.
    pub(super) fn open_video(
        &mut self,
        args: &Args,
        profile: &Profile,
        power_on: Duration,
    ) -> Result<()> {
        let bits = profile.camera.sensor.bits;
        (self.served.video, self.about) = open_video(args, self.firmware(), bits, power_on)?;
        Ok(())
    }

    pub(super) fn firmware(&self) -> &Firmware {
        self.served.device.machine.firmware()
    }

    /// Sets the USB link of the device, and the description of its camera to that of the link.
    pub(super) fn set_usb(&mut self, (link, about): (UsbLink, String)) {
        self.served.usb = Some(link);
        self.about = about;
    }

    /// Creates the file of the device's recording.
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
        self.served.recording = Some(Recording {
            file,
            path: path.to_owned(),
            started_unix_s: unix_s(),
        });
        Ok(())
    }

    /// Serves the device from a directory, on a thread of its own; calls `ended` when the device
    /// stops. Returns the served device and a description of its camera.
    ///
    /// # Errors
    /// Returns an error if the system refuses a thread, a port or a socket.
    pub(super) fn start(
        self,
        run_dir: RunDir,
        wall: impl Fn() -> Duration + Clone + Send + 'static,
        ended: impl FnOnce() + Send + 'static,
    ) -> Result<(Serving, String)> {
        let Self {
            served,
            about,
            made,
        } = self;
        let serving = Serving::start(served, run_dir, wall, ended)?;
        if let Some(made) = &made {
            made.kept.set(true);
        }
        Ok((serving, about))
    }
}

/// Makes an event loop for the calling thread.
pub(crate) fn runtime() -> Result<tokio::runtime::Runtime> {
    tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(|e| Error::io("event loop", e))
}
