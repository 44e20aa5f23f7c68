//! A conversation with a device at the end of a link, and with its camera.

use super::links::{Link, Missing};
#[cfg(target_os = "linux")]
use super::served::{Exit, serve};
use crate::desk::{Desk, Link as Carried};
use phasmid_core::error::{Error, Result};
use phasmid_device::Device;
use phasmid_host::{Camera, CommandPort, Instrument, Intake};
#[cfg(target_os = "linux")]
use phasmid_host::{
    CameraDriver, SerialPort, open_camera,
    usb::{UsbAddress, UsbCamera, UsbDevice, UsbPort},
};
use phasmid_profile::{Profile, Scene};
use phasmid_protocol::Frame;
use phasmid_report::lab::Context;
#[cfg(target_os = "linux")]
use std::sync::Arc;
use std::time::Duration;

/// More than any link takes.
pub(super) const TIMEOUT: Duration = Duration::from_secs(20);

/// Frames that may be there before the one that was asked for: those of a camera that ran free, and
/// the one that a node of v4l2loopback keeps of its last stream.
const MOST_STALE: usize = 10_000;

/// A conversation with a device, and its camera.
pub(super) struct Talk {
    pub(super) instrument: Instrument<Box<dyn CommandPort + Send>>,
    pub(super) camera: Box<dyn Camera + Send>,
}

impl Talk {
    /// Waits for triggers in a mode, and only then opens the camera, which runs free until then.
    fn new(
        port: Box<dyn CommandPort + Send>,
        mode: &str,
        open: impl FnOnce() -> Result<Box<dyn Camera + Send>>,
    ) -> Result<Self> {
        let mut instrument = Instrument::open(port, TIMEOUT)?;
        instrument.order(&format!("ABOR;:TRIG:SOUR BUS;MODE {mode}"))?;
        let camera = open()?;
        Ok(Self { instrument, camera })
    }

    /// The next frame, which has to be that of a pattern.
    pub(super) fn frame(&mut self, index: usize) -> Result<Frame> {
        match self.camera.next_frame(TIMEOUT)? {
            Some(frame) if is(&frame, index) => Ok(frame),
            Some(_) => Err(Error::device(format!("frame {index} is another"))),
            None => Err(Error::device(format!("no frame {index} within 20 s"))),
        }
    }

    /// The frame of a pattern, behind whatever an earlier stream has left.
    pub(super) fn first_frame(&mut self, index: usize) -> Result<Frame> {
        for _ in 0..MOST_STALE {
            match self.camera.next_frame(TIMEOUT) {
                Ok(Some(frame)) if is(&frame, index) => return Ok(frame),
                Ok(Some(_)) => {}
                Err(_) if self.camera.has_skipped() => {}
                Ok(None) => break,
                Err(e) => return Err(e),
            }
        }
        Err(Error::device(format!("no frame {index} within 20 s")))
    }
}

fn is(frame: &Frame, index: usize) -> bool {
    frame.pattern_index.is_some_and(|i| i as usize == index)
}

/// Has work done with a device at the end of a link. The trigger's mode is `STEP` or `SEQ`.
pub(super) fn over<T>(
    ctx: &Context<'_>,
    (profile, scene): (&Profile, &Scene),
    (link, mode): (Link, &str),
    work: impl FnOnce(&mut Talk) -> Result<T>,
) -> Result<T, Missing> {
    if link != Link::Memory {
        return served(ctx, (profile, scene), (link, mode), work);
    }
    let device = Device::builder(profile, scene).seed(ctx.seed).build()?;
    let desk = Desk::new(device, Carried::Identified);
    let port = Box::new(desk.port());
    let open = || Ok(Box::new(Intake::new(desk.camera())) as Box<dyn Camera + Send>);
    Ok(work(&mut Talk::new(port, mode, open)?)?)
}

#[cfg(not(target_os = "linux"))]
fn served<T>(
    _: &Context<'_>,
    _: (&Profile, &Scene),
    _: (Link, &str),
    _: impl FnOnce(&mut Talk) -> Result<T>,
) -> Result<T, Missing> {
    let why = "devices are served on Linux only";
    Err(Missing::Lack(why.to_owned()))
}

#[cfg(target_os = "linux")]
fn served<T>(
    ctx: &Context<'_>,
    (profile, scene): (&Profile, &Scene),
    (link, mode): (Link, &str),
    work: impl FnOnce(&mut Talk) -> Result<T>,
) -> Result<T, Missing> {
    let exit = match link {
        Link::Tcp => Exit::Tcp,
        Link::UsbIp => Exit::Usb,
        Link::Kernel => Exit::Kernel,
        Link::Video => Exit::Video,
        Link::Socket | Link::Memory => Exit::None,
    };
    let dir = ctx.folder.path().join("run");
    let served = serve(profile, scene, ctx.seed, exit, &dir)?;
    let at = served.endpoints();
    let done = if link == Link::UsbIp {
        let address = UsbAddress::parse(&at.camera, "the served device")?;
        let device = Arc::new(UsbDevice::open(&address, TIMEOUT)?);
        let port = Box::new(UsbPort::open(&device)?);
        let open =
            || Ok(Box::new(Intake::new(UsbCamera::open(&device, None)?)) as Box<dyn Camera + Send>);
        work(&mut Talk::new(port, mode, open)?)?
    } else {
        let address = match exit {
            Exit::Tcp => at.camera_tcp.as_deref().unwrap_or_default(),
            _ => &at.camera,
        };
        let control = match (&at.control_usb, exit) {
            (Some(tty), Exit::Kernel) => tty.to_string_lossy(),
            _ => at.control.to_string_lossy(),
        };
        let port = Box::new(SerialPort::open(&control)?);
        let open = || open_camera(address, CameraDriver::Auto, TIMEOUT);
        work(&mut Talk::new(port, mode, open)?)?
    };
    served.stop()?;
    Ok(done)
}
