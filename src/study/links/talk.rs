//! A conversation with a device at the end of a link, and with its camera.

use super::link::Link;
use crate::desk::{Desk, Link as Carried};
use phasmid_core::error::{Error, Result};
use phasmid_device::Device;
#[cfg(target_os = "linux")]
use phasmid_device::link::{CameraNode, ServeOptions, Serving, Tcp, UsbServing};
use phasmid_host::{Camera, CommandPort, Instrument, Intake};
#[cfg(target_os = "linux")]
use phasmid_host::{
    CameraDriver, SerialPort, open_camera,
    usb::{UsbAddress, UsbCamera, UsbDevice, UsbPort},
};
use phasmid_profile::{Profile, Scene};
use phasmid_protocol::Frame;
#[cfg(target_os = "linux")]
use phasmid_protocol::service::ClockPace;
use phasmid_report::stopwatch::Stopwatch;
#[cfg(target_os = "linux")]
use std::sync::Arc;
use std::time::Duration;

/// Timeout for all operations: longer than any link takes.
const TIMEOUT: Duration = Duration::from_secs(20);
/// After this time without a frame, a link that can lose frames is assumed to deliver no more frames.
const QUIET: Duration = Duration::from_millis(800);
/// Maximum number of frames before the requested one: a free-running camera has sent some, and a
/// v4l2loopback node keeps the last frame of its previous stream.
const MOST_STALE: usize = 10_000;

/// Reason why a link was not measured.
pub(super) enum Missing {
    /// This machine lacks what the link needs.
    Lack(String),
    /// The link fails.
    Broken(Error),
}

impl From<Error> for Missing {
    fn from(e: Error) -> Self {
        Self::Broken(e)
    }
}

/// A conversation with a device, and its camera.
pub(super) struct Talk {
    instrument: Instrument<Box<dyn CommandPort + Send>>,
    camera: Box<dyn Camera + Send>,
}

impl Talk {
    /// Creates a conversation: stops the free-running device, then opens the camera.
    fn new(
        port: Box<dyn CommandPort + Send>,
        open: impl FnOnce() -> Result<Box<dyn Camera + Send>>,
    ) -> Result<Self> {
        let mut instrument = Instrument::open(port, TIMEOUT)?;
        instrument.order("ABOR;:TRIG:SOUR BUS;MODE STEP")?;
        let camera = open()?;
        Ok(Self { instrument, camera })
    }

    /// Runs one sequence frame by frame, to drop frames of an earlier stream and to let the device
    /// compute its tables.
    pub(super) fn prepare_triggers(&mut self, patterns: usize) -> Result<()> {
        self.instrument.order("INIT")?;
        for index in 0..patterns {
            self.instrument.tell("*TRG")?;
            self.first_frame(index)?;
        }
        Ok(())
    }

    /// Returns the latencies of the frames of one sequence in seconds: each from before its trigger is
    /// written until the camera has returned the frame.
    pub(super) fn triggered(&mut self, watch: Stopwatch<'_>, patterns: usize) -> Result<Vec<f64>> {
        self.instrument.order("INIT")?;
        let triggers = (0..patterns).map(|index| {
            let (frame, seconds) = watch.timed(|| {
                self.instrument.tell("*TRG")?;
                self.frame(index)
            });
            frame.map(|_| seconds)
        });
        triggers.collect()
    }

    /// Changes to one trigger per sequence, and runs one sequence until the camera has no more frames.
    pub(super) fn prepare_sequences(&mut self, patterns: usize) -> Result<()> {
        self.instrument.order("ABOR;:TRIG:MODE SEQ")?;
        self.instrument.order("INIT")?;
        self.instrument.tell("*TRG")?;
        let (mut came, mut over) = (0, false);
        loop {
            let wait = if over { QUIET } else { TIMEOUT };
            match self.camera.next_frame(wait) {
                Ok(None) if came > 0 => return Ok(()),
                Ok(None) => return Err(late(0)),
                Ok(Some(frame)) => {
                    came += 1;
                    // The first frame may be the last of an earlier stream.
                    over |= is(&frame, patterns - 1) && came > 1;
                }
                Err(_) if self.camera.has_skipped() => {}
                Err(e) => return Err(e),
            }
        }
    }

    /// Runs a sequence; returns the number of frames that arrived, and the seconds until the last of
    /// them.
    pub(super) fn sequence(
        &mut self,
        watch: Stopwatch<'_>,
        patterns: usize,
        may_lose: bool,
    ) -> Result<(usize, f64)> {
        self.instrument.order("INIT")?;
        let begin = watch.now_s();
        self.instrument.tell("*TRG")?;
        let (mut came, mut next, mut last_s) = (0, 0, begin);
        while next < patterns {
            let wait = if may_lose && came > 0 { QUIET } else { TIMEOUT };
            let Some(frame) = self.camera.next_frame(wait)? else {
                break;
            };
            last_s = watch.now_s();
            let index = frame.pattern_index.map_or(usize::MAX, |i| i as usize);
            if index != next && !(may_lose && (next..patterns).contains(&index)) {
                return Err(other(next));
            }
            came += 1;
            next = index + 1;
        }
        if came == 0 || (next < patterns && !may_lose) {
            return Err(late(next));
        }
        Ok((came, last_s - begin))
    }

    /// Returns the next frame, which must show the pattern `index`.
    fn frame(&mut self, index: usize) -> Result<Frame> {
        match self.camera.next_frame(TIMEOUT)? {
            Some(frame) if is(&frame, index) => Ok(frame),
            Some(_) => Err(other(index)),
            None => Err(late(index)),
        }
    }

    /// Waits for the frame of a pattern, and drops the frames of an earlier stream before it.
    fn first_frame(&mut self, index: usize) -> Result<()> {
        for _ in 0..MOST_STALE {
            match self.camera.next_frame(TIMEOUT) {
                Ok(Some(frame)) if is(&frame, index) => return Ok(()),
                Ok(Some(_)) => {}
                Err(_) if self.camera.has_skipped() => {}
                Ok(None) => break,
                Err(e) => return Err(e),
            }
        }
        Err(late(index))
    }
}

fn is(frame: &Frame, index: usize) -> bool {
    frame.pattern_index.is_some_and(|i| i as usize == index)
}

fn late(index: usize) -> Error {
    let seconds = TIMEOUT.as_secs();
    Error::device(format!("frame {index} has not arrived within {seconds} s"))
}

fn other(index: usize) -> Error {
    Error::device(format!("another frame arrived in place of frame {index}"))
}

/// Calls `work` with a device at the end of a link.
pub(super) fn over(
    (profile, scene): (&Profile, &Scene),
    link: Link,
    work: impl FnOnce(&mut Talk) -> Result<()>,
) -> Result<(), Missing> {
    let device = Device::builder(profile, scene).build()?;
    if link != Link::Memory {
        return served(device, link, work);
    }
    let desk = Desk::new(device, Carried::Identified);
    let port = Box::new(desk.port());
    let open = || Ok(Box::new(Intake::new(desk.camera())) as Box<dyn Camera + Send>);
    Ok(work(&mut Talk::new(port, open)?)?)
}

#[cfg(not(target_os = "linux"))]
fn served(_: Device, _: Link, _: impl FnOnce(&mut Talk) -> Result<()>) -> Result<(), Missing> {
    let why = "devices are served on Linux only";
    Err(Missing::Lack(why.to_owned()))
}

/// Serves a device within the process, as `phasmid serve --clock fast` does.
#[cfg(target_os = "linux")]
fn served(
    device: Device,
    link: Link,
    work: impl FnOnce(&mut Talk) -> Result<()>,
) -> Result<(), Missing> {
    let serving = serve(device, link)?;
    let at = serving.endpoints();
    if link == Link::UsbIp {
        let address = UsbAddress::parse(&at.camera, "the served device")?;
        let device = Arc::new(UsbDevice::open(&address, TIMEOUT)?);
        let port = Box::new(UsbPort::open(&device)?);
        let open =
            || Ok(Box::new(Intake::new(UsbCamera::open(&device, None)?)) as Box<dyn Camera + Send>);
        work(&mut Talk::new(port, open)?)?;
    } else {
        let address = match link {
            Link::Tcp => at.camera_tcp.as_deref().unwrap_or_default(),
            _ => &at.camera,
        };
        let control = match (&at.control_usb, link) {
            (Some(tty), Link::Kernel) => tty.to_string_lossy(),
            _ => at.control.to_string_lossy(),
        };
        let port = Box::new(SerialPort::open(&control)?);
        let open = || open_camera(address, CameraDriver::Auto, TIMEOUT);
        work(&mut Talk::new(port, open)?)?;
    }
    Ok(serving.stop()?)
}

#[cfg(target_os = "linux")]
fn serve(device: Device, link: Link) -> Result<Serving, Missing> {
    let options = ServeOptions {
        clock: match link {
            Link::Video => ClockPace::Real,
            _ => ClockPace::Fast,
        },
        tcp: (link == Link::Tcp).then_some(Tcp {
            port: 0,
            token: None,
        }),
        camera: match link {
            Link::Video => CameraNode::Any,
            _ => CameraNode::None,
        },
        usb: matches!(link, Link::UsbIp | Link::Kernel).then(|| UsbServing {
            attach: link == Link::Kernel,
            ..UsbServing::default()
        }),
        ..ServeOptions::default()
    };
    let has_nodes = |serving: &Serving| {
        let at = serving.endpoints();
        at.control_usb.is_some() && at.camera.starts_with("/dev/")
    };
    match device.serve(&options) {
        Ok(serving) if link == Link::Kernel && !has_nodes(&serving) => {
            let why = "the kernel's drivers have not created both nodes of the USB device";
            Err(Missing::Lack(why.to_owned()))
        }
        Ok(serving) => Ok(serving),
        Err(e) if matches!(link, Link::Kernel | Link::Video) => Err(Missing::Lack(e.to_string())),
        Err(e) => Err(e.into()),
    }
}
