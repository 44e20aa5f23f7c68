//! A device on its way into the world: its ports and sockets are opened, and the loop that serves it
//! begins.

use super::frame_socket::FrameSocket;
use super::history::History;
use super::optics::Optics;
use super::pace::Pace;
use super::pty::Pty;
use super::run_dir::{CAMERA, CONTROL, RunDir, SERVICE};
use super::server::Server;
use super::service::ServiceSocket;
use super::stage::Stage;
use super::tap::{Recording, Tap};
use super::timeline::Seat;
use super::usb::{Binding, Nodes};
use super::video::VideoOutput;
use crate::{Machine, Renderer};
use phasmid_core::error::{Error, Result};
use phasmid_profile::RigPlace;
use phasmid_protocol::Endpoints;
use std::future::Future;
use std::path::Path;
use std::time::Duration;

/// What is served.
pub struct Device {
    /// All of it but the optics.
    pub machine: Machine,
    /// The optics.
    pub renderer: Renderer,
    /// Its place in device time.
    pub seat: Seat,
    /// The scene that it looks at, with whoever else does.
    pub stage: Stage,
    /// Where its rig stands there.
    pub rig: RigPlace,
    /// `*IDN?` of the device, for `device.json`.
    pub name: String,
    /// Profile as it was chosen, for `device.json`.
    pub profile: String,
    /// Scene as it was chosen, for `device.json`.
    pub scene: String,
    /// Seed of the noise, for `device.json`.
    pub seed: u64,
    /// Dialect of the control port, its name or the path of its file, for `device.json`.
    pub dialect: String,
    /// Bits per second of the control port, for `device.json`.
    pub baud: Option<u32>,
    /// Port on the loopback interface for frames; 0 picks a free one.
    pub tcp: Option<u16>,
    /// The camera as a V4L2 node, ready for the firmware's stream; the frame socket is there too.
    pub video: Option<VideoOutput>,
    /// Camera and port as a USB device; pty and frame socket are there too.
    pub usb: Option<UsbLink>,
    /// Where what passes between it and its clients is recorded.
    pub recording: Option<Recording>,
    /// Takes what whoever looks after the device should know.
    pub notice: fn(&str),
}

/// A device's USB side.
pub struct UsbLink {
    /// What its server serves.
    pub binding: Binding,
    /// Where it can be taken: `usb:HOST:PORT/BUSID`.
    pub address: String,
    /// What this machine's kernel has made of it.
    pub nodes: Nodes,
}

/// Serves a device from a run directory until `shutdown` is done, in a tokio runtime. `wall` tells
/// for how long the device has been on; `ready` is called once everything can be reached.
///
/// # Errors
/// Ports and sockets that the system refuses, or optics that have died.
pub async fn serve(
    mut device: Device,
    mut run_dir: RunDir,
    wall: impl Fn() -> Duration + Clone + Send + 'static,
    ready: impl FnOnce(&Endpoints),
    shutdown: impl Future<Output = ()>,
) -> Result<()> {
    let pty = Pty::open()?;
    let control = run_dir.file(CONTROL);
    point(&control, &pty)?;
    let camera_path = run_dir.file(CAMERA);
    let camera = FrameSocket::open(&camera_path, device.tcp)?;
    let service_path = run_dir.file(SERVICE);
    let service = ServiceSocket::open(&service_path)?;
    let camera_socket = format!("socket:{}", camera_path.display());
    let (usb_address, nodes) = match &device.usb {
        Some(usb) => (Some(usb.address.clone()), usb.nodes.clone()),
        None => (None, Nodes::default()),
    };
    let node = nodes.camera.map(|path| path.display().to_string());
    let endpoints = Endpoints {
        name: device.name,
        pid: std::process::id(),
        profile: Some(device.profile),
        scene: Some(device.scene),
        seed: Some(device.seed),
        clock: Some(device.seat.timeline().about().pace),
        control: control.clone(),
        dialect: Some(device.dialect),
        baud: device.baud,
        control_usb: nodes.tty,
        camera: match &device.video {
            Some(video) => video.address(),
            None => node
                .or_else(|| usb_address.clone())
                .unwrap_or_else(|| camera_socket.clone()),
        },
        camera_socket,
        camera_tcp: camera.tcp_address().map(|address| format!("tcp:{address}")),
        usb: usb_address,
        service: service_path,
    };
    let optics = Optics::start(device.renderer, wall.clone(), device.notice)
        .map_err(|e| Error::io("optics", e))?;
    if let Some(video) = &device.video {
        device
            .machine
            .firmware_mut()
            .attach(Box::new(video.clone()));
    }
    if let Some(usb) = &device.usb {
        let gate = usb.binding.gate(device.machine.firmware().stream());
        device.machine.firmware_mut().attach(Box::new(gate));
    }
    let now = device.seat.now_ns();
    let tap = Tap::start(device.recording, &endpoints, now, device.notice)?;
    run_dir.publish(&endpoints)?;
    ready(&endpoints);
    let server = Server {
        machine: device.machine,
        seat: device.seat,
        handled_ns: 0,
        stage: device.stage,
        version: 0,
        rig: device.rig,
        history: History::default(),
        name: endpoints.name,
        bytes: (0, 0),
        optics,
        pty: Some(pty),
        control,
        camera,
        video: device.video,
        usb: device.usb.map(|usb| usb.binding),
        reply_to_usb: false,
        pace: Pace::default(),
        notice: device.notice,
        lost: 0,
        usb_lost: false,
        service,
        tap,
        stall: None,
        stalled_at: 0,
    };
    server.run(wall, shutdown).await
}

/// Puts a link to a pty.
pub(super) fn point(control: &Path, pty: &Pty) -> Result<()> {
    std::os::unix::fs::symlink(pty.path(), control).map_err(|e| Error::io(control, e))
}
