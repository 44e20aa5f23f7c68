//! From a trigger's command to the whole frame at the host, over each link.
//!
//! The device's clock is the fast one: what would be exposure on a real device takes no time, and
//! what is measured is what a link and a rendering take. A trigger is `*TRG` in mode `STEP`, which
//! exposes the next pattern; time runs from before the command is written until the camera has given
//! the frame with that pattern.

use super::passes::bench;
#[cfg(target_os = "linux")]
use super::served::{Exit, Served};
use crate::emulator::Renderer;
use crate::emulator::port::Port;
use crate::error::{Error, Result};
use crate::host::{Camera, CommandPort, Instrument};
#[cfg(target_os = "linux")]
use crate::host::{
    Capture, Intake, SerialPort, open_camera,
    usb::{UsbAddress, UsbCamera, UsbDevice, UsbPort},
};
use crate::profile::Profile;
use crate::profile::Scene;
use crate::profile::faults::Schedule;
use crate::study::faults::{Desk, DeskCamera, DeskPort, Link};
use crate::study::lab::{Context, Row, Settings, Trial};
use crate::study::timing::{Stopwatch, quantile};
use std::cell::RefCell;
use std::rc::Rc;
#[cfg(target_os = "linux")]
use std::sync::Arc;
use std::time::Duration;

/// More than any link takes.
const TIMEOUT: Duration = Duration::from_secs(20);

/// The links, in the order of the table.
const LINKS: [&str; 5] = [
    "in memory",
    "pty and frame socket",
    "pty and TCP",
    "USB/IP",
    "pty and V4L2",
];

/// A trial for each link.
pub fn trials(settings: &Settings) -> Vec<Trial> {
    let trial = |link: &'static str| {
        let key = format!("latency/{}", link.replace(' ', "-"));
        Trial::new(key, settings.seed, move |ctx| run(ctx, link)).alone()
    };
    LINKS.into_iter().map(trial).collect()
}

fn run(ctx: &Context<'_>, link: &'static str) -> Result<Vec<Row>> {
    let mut profile = bench(ctx.settings)?;
    let count = if ctx.settings.quick { 44 } else { 1100 };
    // Each link is held to carry the same: the rows of pixels alone.
    profile.camera.data_line = false;
    let scene = Scene::load("trapezoid")?;
    let bytes = profile.camera.width_px as usize * profile.camera.height_px as usize;
    let row = Row::new().text("group", "latency").text("name", link);
    let found = match link {
        "in memory" => in_memory(ctx, &profile, &scene, count),
        _ => served(ctx, &profile, &scene, count, link),
    };
    Ok(vec![match found {
        Ok(mut seconds) => {
            seconds.sort_by(f64::total_cmp);
            let us = |share| quantile(&seconds, share) * 1e6;
            row.number("frames", seconds.len() as f64)
                .number("bytes", bytes as f64)
                .number("median_us", us(0.5))
                .number("p99_us", us(0.99))
                .number("least_us", us(0.0))
                .number("most_us", us(1.0))
                .number("copy_us", ctx.stopwatch().seconds_a_copy(bytes) * 1e6)
        }
        // Machines differ in what they have, so this is no failure of the study.
        Err(Lack(why)) => row.text("note", &why),
    }])
}

/// Why a link was not measured.
struct Lack(String);

impl From<Error> for Lack {
    fn from(e: Error) -> Self {
        Self(e.to_string())
    }
}

/// The seconds of so many triggers, after a first sequence that makes what is made once.
fn triggered<P: CommandPort, C: Camera>(
    watch: Stopwatch<'_>,
    port: P,
    open: impl FnOnce() -> Result<C>,
    (frames, count): (usize, usize),
) -> Result<Vec<f64>> {
    let mut instrument = Instrument::open(port, TIMEOUT)?;
    instrument.order("TRIG:SOUR BUS;MODE STEP")?;
    let mut camera = open()?;
    let mut seconds = Vec::new();
    while seconds.len() < count + frames {
        instrument.order("INIT")?;
        for index in 0..frames {
            let (frame, took) = watch.timed(|| {
                instrument.tell("*TRG")?;
                camera.next_frame(TIMEOUT)
            });
            let Some(frame) = frame? else {
                return Err(Error::device(format!("no frame {index} within 20 s")));
            };
            let strange = frame.pattern_index.is_some_and(|i| i as usize != index);
            if strange {
                return Err(Error::device(format!("frame {index} is another")));
            }
            seconds.push(took);
        }
    }
    seconds.drain(..frames);
    seconds.truncate(count);
    Ok(seconds)
}

fn patterns(profile: &Profile) -> usize {
    profile.sequence[0].frame.len()
}

fn in_memory(
    ctx: &Context<'_>,
    profile: &Profile,
    scene: &Scene,
    count: usize,
) -> Result<Vec<f64>, Lack> {
    let renderer = Renderer::new(profile, scene, ctx.seed)?;
    let schedule = Schedule::default();
    let desk = Desk::new(
        profile,
        renderer,
        Port::default(),
        Link::Identified,
        &schedule,
    )?;
    let desk = Rc::new(RefCell::new(desk));
    let port = DeskPort::open(&desk);
    let counts = (patterns(profile), count);
    let seconds = triggered(
        ctx.stopwatch(),
        port,
        || Ok(DeskCamera::open(&desk)),
        counts,
    )?;
    Ok(seconds)
}

#[cfg(not(target_os = "linux"))]
fn served(
    _: &Context<'_>,
    _: &Profile,
    _: &Scene,
    _: usize,
    _: &'static str,
) -> Result<Vec<f64>, Lack> {
    Err(Lack("devices are served on Linux only".to_owned()))
}

#[cfg(target_os = "linux")]
fn served(
    ctx: &Context<'_>,
    profile: &Profile,
    scene: &Scene,
    count: usize,
    link: &'static str,
) -> Result<Vec<f64>, Lack> {
    let exit = match link {
        "pty and TCP" => Exit::Tcp,
        "USB/IP" => Exit::Usb,
        "pty and V4L2" => Exit::Video,
        _ => Exit::None,
    };
    let dir = ctx.folder.path().join("run");
    let served = Served::start(profile, scene, ctx.seed, exit, &dir)?;
    let counts = (patterns(profile), count);
    let watch = ctx.stopwatch();
    let at = &served.at;
    let seconds = if exit == Exit::Usb {
        let address = UsbAddress::parse(&at.camera, "the served device")?;
        let device = Arc::new(UsbDevice::open(&address, TIMEOUT)?);
        let port = UsbPort::open(&device)?;
        let open = || Ok(Intake::new(UsbCamera::open(&device, None)?));
        triggered(watch, port, open, counts)?
    } else {
        let address = match exit {
            Exit::Tcp => at.camera_tcp.as_deref().unwrap_or_default(),
            _ => &at.camera,
        };
        let control = at.control.to_string_lossy();
        let port = SerialPort::open(&control)?;
        let open = || open_camera(address, Capture::Auto, TIMEOUT);
        triggered(watch, port, open, counts)?
    };
    served.stop()?;
    Ok(seconds)
}
