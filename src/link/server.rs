//! The loop that serves a device: commands in, replies and frames out, device time in between.
//! One thread runs it, the optics have their own.

use super::frame_socket::FrameSocket;
use super::optics::Optics;
use super::pace::Pace;
use super::pty::{Event, Pty};
use super::run_dir::{CAMERA, CONTROL, RunDir, SERVICE};
use super::service::{Call, ServiceSocket};
use super::tap::{Recording, Tap};
use super::usb::{Binding, Nodes, PortEvent};
use super::video::{Put, VideoOutput};
use crate::emulator::{Clock, FrameSink, Machine, Renderer, State};
use crate::error::{Error, Result};
use crate::protocol::record::Channel;
use crate::protocol::service::{Action, Item, Reply, Request};
use crate::protocol::{Endpoints, Frame};
use std::future::Future;
use std::path::{Path, PathBuf};
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::oneshot;
use tokio::time::Instant;

/// Exposures that may wait for the optics; device time stands still beyond that.
const MAX_BACKLOG: usize = 8192;
/// Exposures of a free-running camera that may wait; those beyond are dropped, as a camera does.
const MAX_FREE_BACKLOG: usize = 2;
/// A block that stops coming for so long will not come.
const STALL: Duration = Duration::from_secs(1);

/// What is served.
pub struct Device {
    /// All of it but the optics.
    pub machine: Machine,
    /// The optics.
    pub renderer: Renderer,
    /// How device time passes.
    pub clock: Box<dyn Clock + Send>,
    /// `*IDN?` of the device, for `device.json`.
    pub name: String,
    /// Profile as it was chosen, for `device.json`.
    pub profile: String,
    /// Scene as it was chosen, for `device.json`.
    pub scene: String,
    /// Seed of the noise, for `device.json`.
    pub seed: u64,
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
        profile: device.profile,
        scene: device.scene,
        seed: device.seed,
        control: control.clone(),
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
    let now = device.clock.now_ns(wall());
    let tap = Tap::start(device.recording, &endpoints, now, device.notice)?;
    run_dir.publish(&endpoints)?;
    ready(&endpoints);
    let server = Server {
        machine: device.machine,
        clock: device.clock,
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

struct Server {
    machine: Machine,
    clock: Box<dyn Clock + Send>,
    optics: Optics,
    /// `None` while the port is gone, as when a cable is pulled.
    pty: Option<Pty>,
    /// What points to the pty.
    control: PathBuf,
    camera: FrameSocket,
    video: Option<VideoOutput>,
    usb: Option<Binding>,
    /// The last command came over USB, and so the replies go there; the end of a connection of the
    /// port's other end is none of that one's business.
    reply_to_usb: bool,
    pace: Pace,
    notice: fn(&str),
    /// Frames that the V4L2 node did not take.
    lost: u64,
    /// A USB host has missed frames.
    usb_lost: bool,
    service: ServiceSocket,
    /// Records what passes.
    tap: Tap,
    /// When to give up on a block.
    stall: Option<Instant>,
    /// Bytes that the device had taken in when the block last went on.
    stalled_at: u64,
}

impl Server {
    async fn run(
        mut self,
        wall: impl Fn() -> Duration,
        shutdown: impl Future<Output = ()>,
    ) -> Result<()> {
        let mut shutdown = pin!(shutdown);
        loop {
            let now = self.clock.now_ns(wall());
            let attended = self.attended();
            self.machine.firmware_mut().set_streaming(attended, now);
            self.machine.advance(now);
            self.plug(now)?;
            self.tap.faults(self.machine.faults());
            self.hand_on(now, wall())?;
            self.dispatch(now, wall());
            if let Some(usb) = &mut self.usb {
                usb.refresh(self.machine.firmware(), wall());
            }
            self.watch_block();
            let crowded = self.optics.backlog() >= MAX_BACKLOG;
            let full = crowded || self.machine.crowded();
            let free = matches!(self.machine.firmware().state(), State::Free { .. });
            // The optics' next frame wakes the loop in these cases.
            let behind = crowded || free && self.optics.backlog() >= MAX_FREE_BACKLOG;
            let next = self.machine.next_event_ns(behind);
            let delay = next.map(|next| self.clock.wait(next, wall()));
            tokio::select! {
                biased;
                () = &mut shutdown => return Ok(()),
                frame = self.optics.next(), if !self.pace.holds() => {
                    let frame = frame?;
                    let now = self.clock.now_ns(wall());
                    self.machine.rendered(Some(frame), now);
                }
                frame = self.pace.due() => self.deliver(&frame, wall())?,
                changed = self.camera.changed() => {
                    changed.map_err(|e| Error::io(CAMERA, e))?;
                    self.camera.accept(self.machine.firmware().next_id());
                    self.tap.cameras(self.camera.counts(), self.clock.now_ns(wall()));
                }
                (request, reply) = self.service.next() => {
                    let now = self.clock.now_ns(wall());
                    self.serve_call((request, reply), now);
                }
                event = next_of(self.pty.as_mut()), if !full => {
                    // Who connected before the command was sent gets the frames that it causes,
                    // whichever of the two this loop noticed first.
                    self.camera.accept(self.machine.firmware().next_id());
                    let now = self.clock.now_ns(wall());
                    self.tap.cameras(self.camera.counts(), now);
                    let attended = self.attended();
                    self.machine.firmware_mut().set_streaming(attended, now);
                    match event? {
                        Event::Data(bytes) => {
                            self.reply_to_usb = false;
                            self.tap.sent(Channel::Control, &bytes, now);
                            self.machine.receive(&bytes, now);
                        }
                        Event::HungUp if self.reply_to_usb => continue,
                        Event::HungUp => {
                            self.tap.left(Channel::Control, now);
                            self.machine.hang_up();
                        }
                    }
                }
                () = changed(self.usb.as_ref()), if !full => {
                    let now = self.clock.now_ns(wall());
                    self.work_off_usb(now);
                }
                () = sleep(delay) => {}
                () = sleep_until(self.stall) => {
                    self.stall = None;
                    self.machine.input_stalled();
                }
            }
        }
    }

    /// Takes the port away, or puts it back, as the device's faults have it: a client sees that the
    /// other end has gone, and finds a new port under the old name later.
    fn plug(&mut self, now_ns: u64) -> Result<()> {
        match (self.machine.connected(now_ns), &self.pty) {
            (false, Some(_)) => {
                self.tap.plugged(false, now_ns);
                let removed = std::fs::remove_file(&self.control);
                self.pty = None;
                removed.map_err(|e| Error::io(&self.control, e))
            }
            (true, None) => {
                let pty = Pty::open()?;
                point(&self.control, &pty)?;
                self.pty = Some(pty);
                self.tap.plugged(true, now_ns);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// A V4L2 node does not tell whether somebody reads: somebody may.
    fn attended(&self) -> bool {
        self.video.is_some()
            || self.camera.attended()
            || self.usb.as_ref().is_some_and(Binding::attended)
    }

    /// Whether somebody is there for whom a free-running camera's frame is worth its rendering.
    fn keeps_up(&self) -> bool {
        self.video.is_some()
            || self.camera.attended()
            || self.usb.as_ref().is_some_and(Binding::keeps_up)
    }

    /// What a USB host has done.
    fn work_off_usb(&mut self, now_ns: u64) {
        let Some(usb) = &mut self.usb else {
            return;
        };
        for event in usb.work_off(self.machine.firmware_mut(), now_ns) {
            match event {
                PortEvent::Data(bytes) => {
                    self.reply_to_usb = true;
                    self.tap.sent(Channel::Usb, &bytes, now_ns);
                    let streaming = self.attended();
                    self.machine.firmware_mut().set_streaming(streaming, now_ns);
                    self.machine.receive(&bytes, now_ns);
                }
                // Whoever speaks at the other end of the port is not concerned.
                PortEvent::HungUp if self.reply_to_usb => {
                    self.tap.left(Channel::Usb, now_ns);
                    self.machine.hang_up();
                }
                PortEvent::HungUp => continue,
            }
        }
    }

    /// Keeps the time at which a block that stops coming is given up.
    fn watch_block(&mut self) {
        if !self.machine.inside_block() {
            self.stall = None;
        } else if self.stall.is_none() || self.machine.taken_in() != self.stalled_at {
            self.stalled_at = self.machine.taken_in();
            self.stall = Some(Instant::now() + STALL);
        }
    }

    /// Hands on the frames that may leave.
    fn hand_on(&mut self, now_ns: u64, wall: Duration) -> Result<()> {
        while !self.pace.holds()
            && let Some(frame) = self.machine.next_frame(now_ns)
        {
            match &self.video {
                Some(_) => self.pace.take(frame, Instant::now()),
                None => self.deliver(&frame, wall)?,
            }
        }
        if !self.pace.holds() {
            self.machine.frames_left();
        }
        Ok(())
    }

    /// Hands a frame to all who read.
    fn deliver(&mut self, frame: &Arc<Frame>, wall: Duration) -> Result<()> {
        self.tap.frame(frame, self.clock.now_ns(wall));
        if let Some(usb) = &self.usb {
            usb.put(frame, wall);
            if usb.lost() > 0 && !self.usb_lost {
                self.usb_lost = true;
                (self.notice)(&format!(
                    "the USB host reads too slowly: frame {} is lost; this is said once",
                    frame.id
                ));
            }
        }
        if let Some(video) = &self.video
            && video.put(frame)? == Put::Lost
        {
            self.lost += 1;
            if self.lost == 1 {
                (self.notice)(&format!(
                    "{} did not take frame {}; this is said once",
                    video.address(),
                    frame.id
                ));
            }
        }
        self.camera.put(frame.clone());
        Ok(())
    }

    /// Hands exposures to the optics and replies to the port.
    fn dispatch(&mut self, now_ns: u64, wall: Duration) {
        for exposure in self.machine.take_exposures(now_ns) {
            let free = exposure.shot.pattern_index.is_none();
            let wanted = if free {
                self.keeps_up() && self.optics.backlog() < MAX_FREE_BACKLOG
            } else {
                self.attended()
            };
            if !wanted {
                self.machine.rendered(None, now_ns);
            } else {
                self.optics.expose(exposure);
            }
        }
        if !self.pace.holds() {
            self.machine.frames_left();
        }
        let output = self.machine.take_output(now_ns);
        if !output.is_empty() {
            let channel = match self.reply_to_usb {
                true => Channel::Usb,
                false => Channel::Control,
            };
            self.tap.received(channel, &output, now_ns);
        }
        let sent = match &self.usb {
            _ if output.is_empty() => true,
            Some(usb) if self.reply_to_usb => usb.send(&output, wall),
            _ => self.pty.as_mut().is_none_or(|pty| pty.send(&output)),
        };
        if !sent {
            self.machine.firmware_mut().reply_lost();
        }
    }

    fn serve_call(&mut self, (request, reply): Call, now_ns: u64) {
        match request {
            Request::Get(Item::Truth) | Request::TruthAt(_) => {
                let time_ns = match request {
                    Request::TruthAt(time_ns) => Some(time_ns),
                    _ => None,
                };
                let (sender, truth) = oneshot::channel();
                let sequence = self.machine.firmware().selected_sequence();
                self.optics.truth(sequence, time_ns, sender);
                let render_us = self.optics.render_us();
                tokio::spawn(async move {
                    let answer = match truth.await {
                        Ok(truth) => {
                            let (reply, payload) = truth.to_maps().encode();
                            (Reply { render_us, ..reply }, payload)
                        }
                        Err(_) => (Reply::refusal("the device is going away"), Vec::new()),
                    };
                    // The client may have left meanwhile.
                    let _ = reply.send(answer);
                });
            }
            Request::Place(placement) => {
                let (sender, placed) = oneshot::channel();
                self.optics.place(placement, sender);
                let render_us = self.optics.render_us();
                tokio::spawn(async move {
                    let answer = match placed.await {
                        Ok(Ok(())) => Reply {
                            render_us,
                            ..Reply::default()
                        },
                        Ok(Err(why)) => Reply::refusal(why),
                        Err(_) => Reply::refusal("the device is going away"),
                    };
                    // The client may have left meanwhile.
                    let _ = reply.send((answer, Vec::new()));
                });
            }
            Request::Do(Action::Trigger) => {
                self.machine.firmware_mut().external_trigger(now_ns);
                self.machine.advance(now_ns);
                let _ = reply.send((Reply::default(), Vec::new()));
            }
        }
    }
}

/// Puts a link to a pty.
fn point(control: &Path, pty: &Pty) -> Result<()> {
    std::os::unix::fs::symlink(pty.path(), control).map_err(|e| Error::io(control, e))
}

pub(super) async fn next_of(pty: Option<&mut Pty>) -> Result<Event> {
    match pty {
        Some(pty) => pty.next().await,
        None => std::future::pending().await,
    }
}

async fn changed(usb: Option<&Binding>) {
    match usb {
        Some(usb) => usb.changed().await,
        None => std::future::pending().await,
    }
}

pub(super) async fn sleep(delay: Option<Duration>) {
    match delay {
        // A timer would take its millisecond even for none.
        Some(Duration::ZERO) => tokio::task::yield_now().await,
        Some(delay) => tokio::time::sleep(delay).await,
        None => std::future::pending().await,
    }
}

async fn sleep_until(time: Option<Instant>) {
    match time {
        Some(time) => tokio::time::sleep_until(time).await,
        None => std::future::pending().await,
    }
}
