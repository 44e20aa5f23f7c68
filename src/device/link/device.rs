//! Starts serving a device: opens its ports and sockets and enters the event loop.

use super::Notice;
use super::frame_socket::{FrameSocket, Tcp};
use super::history::History;
use super::pace::Pace;
use super::pty::{Pty, point};
use super::render_thread::RenderThread;
use super::run_dir::{CAMERA, CONTROL, RunDir, SERVICE};
use super::server::Server;
use super::service::ServiceSocket;
use super::shared_scene::SharedScene;
use super::slowdown::Slowdown;
use super::tap::{Recording, Tap};
use super::timeline::Seat;
use super::usb::Nodes;
use super::usb::export::UsbLink;
use super::video::VideoOutput;
use crate::Device;
use phasmid_core::error::{Error, Result};
use phasmid_profile::RigPlace;
use phasmid_protocol::Endpoints;
use phasmid_protocol::dialect::Dialect;
use phasmid_protocol::record::Observer;
use std::future::Future;
use std::num::NonZeroUsize;
use std::time::Duration;

/// A device to be served.
pub struct ServedDevice {
    /// The device.
    pub device: Device,
    /// The device's seat on the timeline.
    pub seat: Seat,
    /// The scene, shared with other devices.
    pub shared_scene: SharedScene,
    /// Pose of the device's rig in the scene.
    pub rig: RigPlace,
    /// Answer of the device to `*IDN?`, for `device.json`.
    pub name: String,
    /// Name of the device among the devices of its server, for messages.
    pub label: String,
    /// Profile as the user selected it, for `device.json`.
    pub profile: String,
    /// Scene as the user selected it, for `device.json`.
    pub scene: String,
    /// Seed of the noise, for `device.json`.
    pub seed: u64,
    /// Dialect of the control port, as a name or the path of its file, for `device.json`.
    pub dialect: String,
    /// Baud rate of the control port, for `device.json`.
    pub baud: Option<u32>,
    /// Options for serving frames over TCP in addition to the Unix socket.
    pub tcp: Option<Tcp>,
    /// V4L2 node that also receives the frames; it is ready for the firmware's stream format.
    pub video: Option<VideoOutput>,
    /// USB device that offers camera and control port in addition to pty and frame socket.
    pub usb: Option<UsbLink>,
    /// Recording of the traffic between the device and its clients.
    pub recording: Option<Recording>,
    /// Receives the traffic as it happens.
    pub observer: Option<Observer>,
    /// Receives messages for the operator.
    pub notice: Notice,
    /// Number of rendering threads; `None` for rayon's global pool.
    pub threads: Option<NonZeroUsize>,
}

impl ServedDevice {
    /// Prepares to serve a device over a pty and a frame socket only. Profile and scene are
    /// described by their own names.
    pub fn new(device: Device, seat: Seat, shared_scene: SharedScene) -> Self {
        let (profile, scene) = (&device.profile, &device.scene);
        let id = &profile.identity;
        Self {
            seat,
            shared_scene,
            rig: scene.rig,
            name: format!(
                "{},{},{},{}",
                id.manufacturer, id.model, id.serial, id.firmware
            ),
            label: profile.name.clone(),
            profile: profile.name.clone(),
            scene: scene.name.clone(),
            seed: device.seed,
            dialect: Dialect::from_anywhere(&profile.control.dialect_path(&profile.folder)),
            baud: profile.control.baud,
            tcp: None,
            video: None,
            usb: None,
            recording: None,
            observer: None,
            notice: Notice::default(),
            threads: None,
            device,
        }
    }
}

/// Serves a device from a run directory, in a tokio runtime, until `shutdown` completes. `wall`
/// returns how long the device has been on. `published` is called with the content of `device.json`
/// when all ports and sockets are reachable, and again whenever that content changes.
///
/// # Errors
/// Returns an error if the system refuses a port or socket, or if the render thread has failed.
pub async fn serve(
    served: ServedDevice,
    mut run_dir: RunDir,
    wall: impl Fn() -> Duration + Clone + Send + 'static,
    mut published: impl FnMut(&Endpoints),
    shutdown: impl Future<Output = ()>,
) -> Result<()> {
    let Device {
        mut machine,
        renderer,
        ..
    } = served.device;
    let pty = Pty::open()?;
    let control = run_dir.file(CONTROL);
    point(&control, &pty)?;
    let camera_path = run_dir.file(CAMERA);
    let camera = FrameSocket::open(&camera_path, served.tcp.as_ref())?;
    let service_path = run_dir.file(SERVICE);
    let service = ServiceSocket::open(&service_path)?;
    let camera_socket = format!("socket:{}", camera_path.display());
    let (usb_address, nodes) = match &served.usb {
        Some(usb) => (Some(usb.address.clone()), usb.nodes.clone()),
        None => (None, Nodes::default()),
    };
    let node = nodes.camera.map(|path| path.display().to_string());
    let pace = served.seat.timeline().pace();
    if served.video.is_some() {
        served.seat.timeline().keep_real();
    }
    let mut endpoints = Endpoints {
        name: served.name,
        pid: std::process::id(),
        profile: Some(served.profile),
        scene: Some(served.scene),
        seed: Some(served.seed),
        clock: Some(pace),
        slowdown: None,
        control: control.clone(),
        dialect: Some(served.dialect),
        baud: served.baud,
        control_usb: nodes.tty,
        camera: match &served.video {
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
    let render_thread = RenderThread::start(
        renderer,
        served.threads,
        wall.clone(),
        served.notice.clone(),
    )
    .map_err(|e| Error::io("optics", e))?;
    if let Some(video) = &served.video {
        machine.firmware_mut().attach(Box::new(video.clone()));
    }
    if let Some(usb) = &served.usb {
        let gate = usb.binding.gate(machine.firmware().stream());
        machine.firmware_mut().attach(Box::new(gate));
    }
    let now = served.seat.now_ns();
    let tap = Tap::start(
        served.recording,
        served.observer,
        &endpoints,
        now,
        served.notice.clone(),
    )?;
    run_dir.publish(&endpoints)?;
    published(&endpoints);
    let (notice, v4l2) = (served.notice.clone(), served.video.is_some());
    let server = Server {
        machine,
        seat: served.seat,
        handled_ns: 0,
        shared_scene: served.shared_scene,
        version: 0,
        rig: served.rig,
        history: History::default(),
        name: endpoints.name.clone(),
        bytes: (0, 0),
        render_thread,
        slowdown: Slowdown::default(),
        pty: Some(pty),
        control,
        camera,
        video: served.video,
        usb: served.usb.map(|usb| usb.binding),
        reply_to_usb: false,
        pace: Pace::default(),
        notice: served.notice,
        lost: 0,
        usb_lost: false,
        service,
        tap,
        stall: None,
        stalled_at: 0,
    };
    let slow = |factor| {
        if endpoints.slowdown.replace(factor).is_none() {
            notice.tell(&too_slow(&served.label, factor, v4l2));
        }
        if let Err(why) = run_dir.publish(&endpoints) {
            notice.tell(&format!("{}: {why}", served.label));
        }
        published(&endpoints);
    };
    server.run(wall, slow, shutdown).await
}

/// Returns the message for a device that cannot keep up with real time. A V4L2 node needs real time.
fn too_slow(label: &str, factor: f64, v4l2: bool) -> String {
    let clock = if v4l2 { "" } else { "--clock fast, " };
    format!(
        "{label}: frames are rendered {factor} times slower than real time, so they are late or left \
         out; use {clock}fewer pixels or a smaller scene (`phasmid plan` states the costs); reported \
         only once"
    )
}
