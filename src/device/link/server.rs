//! The event loop that serves a device: commands come in, replies and frames go out, in device time.
//! The loop runs on one thread; rendering has a thread of its own.

use super::Notice;
use super::frame_socket::FrameSocket;
use super::history::History;
use super::pace::Pace;
use super::pty::{Event, Pty, point};
use super::render_thread::{RenderThread, Rendered};
use super::run_dir::CAMERA;
use super::service::ServiceSocket;
use super::shared_scene::{Change, SharedScene};
use super::slowdown::Slowdown;
use super::tap::Tap;
use super::timeline::{Seat, Wait};
use super::usb::{Binding, PortEvent};
use super::video::{Put, VideoOutput};
use crate::{FrameSink, Machine, State};
use phasmid_core::error::{Error, Result};
use phasmid_profile::RigPlace;
use phasmid_protocol::Frame;
use phasmid_protocol::record::Channel;
use phasmid_protocol::service::ClockPace;
use std::future::Future;
use std::path::PathBuf;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::oneshot;
use tokio::time::Instant;

/// Maximum number of exposures that wait for the optics; device time stops while this many wait.
const MAX_BACKLOG: usize = 8192;
/// Maximum number of free-running exposures that wait for the optics; further ones are dropped, as a
/// camera does.
const MAX_FREE_BACKLOG: usize = 2;
/// A data block whose bytes pause for this long is abandoned.
const STALL: Duration = Duration::from_secs(1);
/// Events overdue by more than this are handled at the present time, for example after the machine
/// was suspended.
const MAX_LAG_NS: u64 = 1_000_000_000;

/// The state of a served device.
pub(super) struct Server {
    pub(super) machine: Machine,
    pub(super) seat: Seat,
    /// Due time of the last event that was handled.
    pub(super) handled_ns: u64,
    pub(super) shared_scene: SharedScene,
    /// Version of the scene that the optics see.
    pub(super) version: u64,
    pub(super) rig: RigPlace,
    pub(super) history: History,
    /// Answer of `*IDN?`.
    pub(super) name: String,
    /// Number of bytes received and sent on the control port.
    pub(super) bytes: (u64, u64),
    pub(super) render_thread: RenderThread,
    /// Measures by how much rendering is slower than real time.
    pub(super) slowdown: Slowdown,
    /// `None` while the port is disconnected.
    pub(super) pty: Option<Pty>,
    /// Path of the symbolic link to the pty.
    pub(super) control: PathBuf,
    pub(super) camera: FrameSocket,
    pub(super) video: Option<VideoOutput>,
    pub(super) usb: Option<Binding>,
    /// Whether the last command came over USB, so that replies go there. A hang-up of the pty then
    /// does not affect the USB client.
    pub(super) reply_to_usb: bool,
    pub(super) pace: Pace,
    pub(super) notice: Notice,
    /// Number of frames that the V4L2 node did not accept.
    pub(super) lost: u64,
    /// Whether a USB host has missed frames.
    pub(super) usb_lost: bool,
    pub(super) service: ServiceSocket,
    /// Records the traffic.
    pub(super) tap: Tap,
    /// Time at which to abandon the data block being received.
    pub(super) stall: Option<Instant>,
    /// Number of bytes received when the data block last made progress.
    pub(super) stalled_at: u64,
}

impl Server {
    /// Serves until `shutdown` completes; `wall` returns how long the device has been on. `slow` is
    /// called with the ratio of render time to real time when rendering is first found to be too
    /// slow, and whenever the ratio has changed.
    pub(super) async fn run(
        mut self,
        wall: impl Fn() -> Duration,
        mut slow: impl FnMut(f64),
        shutdown: impl Future<Output = ()>,
    ) -> Result<()> {
        let mut shutdown = pin!(shutdown);
        loop {
            let now = self.now();
            let attended = self.attended();
            self.machine.firmware_mut().set_streaming(attended, now);
            self.plug(now)?;
            self.tap.faults(self.machine.faults());
            self.hand_on(now, wall())?;
            self.dispatch(now, wall());
            if let Some(usb) = &mut self.usb {
                usb.refresh(self.machine.firmware(), wall());
            }
            self.watch_block();
            let crowded = self.render_thread.backlog() >= MAX_BACKLOG;
            let full = crowded || self.machine.crowded();
            let free = matches!(self.machine.firmware().state(), State::Free { .. });
            // In both cases the next frame from the optics wakes the loop.
            let behind = crowded || free && self.render_thread.backlog() >= MAX_FREE_BACKLOG;
            let wait = Wait {
                next_ns: self.machine.next_event_ns(behind),
                limit_ns: self.machine.next_event_ns(false).filter(|_| behind),
                settled: self.render_thread.backlog() == 0 && !self.pace.holds(),
            };
            tokio::select! {
                biased;
                () = &mut shutdown => return Ok(()),
                frame = self.render_thread.next(), if !self.pace.holds() => {
                    let Rendered { frame, took, interval } = frame?;
                    let now = self.now();
                    self.machine.rendered(Some(frame), now);
                    if let Some(interval) = interval.filter(|interval| !interval.is_zero()) {
                        self.seat.rendered(interval, took);
                        // The other clocks wait for the rendering, so they have no slowdown.
                        if self.seat.timeline().pace() == ClockPace::Real
                            && let Some(factor) = self.slowdown.rendered(took, interval)
                        {
                            slow(factor);
                        }
                    }
                }
                frame = self.pace.due() => self.deliver(&frame, wall())?,
                changed = self.camera.changed() => {
                    changed.map_err(|e| Error::io(CAMERA, e))?;
                    self.camera.accept(self.machine.firmware().next_id());
                    self.tap.cameras(self.camera.counts(), self.seat.now_ns());
                }
                event = next_of(self.pty.as_mut()), if !full => {
                    // A client that connected before the command was sent receives the frames that
                    // the command causes, even if this loop noticed the command before the
                    // connection.
                    self.camera.accept(self.machine.firmware().next_id());
                    let now = self.now();
                    self.tap.cameras(self.camera.counts(), now);
                    let attended = self.attended();
                    self.machine.firmware_mut().set_streaming(attended, now);
                    match event? {
                        Event::Data(bytes) => {
                            self.reply_to_usb = false;
                            self.bytes.0 += bytes.len() as u64;
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
                    let now = self.now();
                    self.work_off_usb(now);
                }
                // Polled after the ports, because bytes sent to a port before this request must be
                // handled first.
                call = self.service.next() => {
                    let now = self.now();
                    self.serve_call(call, now);
                }
                () = self.seat.wait(wait) => {}
                () = sleep_until(self.stall) => {
                    self.stall = None;
                    self.machine.input_stalled();
                }
            }
        }
    }

    /// Returns the device time up to which all events have been handled, each at its own time.
    fn now(&mut self) -> u64 {
        let now_ns = self.seat.now_ns();
        while let Some(due_ns) = self.machine.next_event_ns(false)
            && due_ns <= now_ns
            // Events that depend on more than device time are handled elsewhere.
            && due_ns > self.handled_ns
        {
            self.seat.handled(due_ns);
            self.handled_ns = due_ns;
            if now_ns - due_ns > MAX_LAG_NS {
                break;
            }
            self.machine.advance(due_ns);
        }
        self.machine.advance(now_ns);
        now_ns
    }

    /// Passes changes of the shared scene to the optics. The returned receiver resolves when the
    /// optics have applied or rejected them.
    pub(super) fn follow(&mut self) -> Option<oneshot::Receiver<Result<()>>> {
        let (mut change, version) = self.shared_scene.since(self.version);
        self.version = version;
        match &mut change {
            Change::Moves(moves) if moves.is_empty() => return None,
            Change::Moves(_) => {}
            Change::Scene(scene) => scene.rig = self.rig,
        }
        let (sender, changed) = oneshot::channel();
        self.render_thread.change(change, sender);
        Some(changed)
    }

    /// Passes on to the optics the changes that other devices have made to the scene. If the optics
    /// reject a change, the operator is notified, because the device that made the change does not learn of
    /// the rejection.
    pub(super) fn follow_others(&mut self) {
        if let Some(changed) = self.follow() {
            let (notice, name) = (self.notice.clone(), self.name.clone());
            tokio::spawn(async move {
                if let Ok(Err(why)) = changed.await {
                    notice.tell(&format!(
                        "{name}: a change of the scene is not shown: {why}"
                    ));
                }
            });
        }
    }

    /// Disconnects or reconnects the port as the device's faults require: a client sees that the
    /// other end has gone, and later finds a new port under the same name.
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

    /// Returns whether clients may be reading frames; a V4L2 node does not report whether it has
    /// readers.
    fn attended(&self) -> bool {
        self.video.is_some()
            || self.camera.attended()
            || self.usb.as_ref().is_some_and(Binding::attended)
    }

    /// Returns whether any client can accept another free-running frame now.
    fn keeps_up(&self) -> bool {
        self.video.is_some()
            || self.camera.attended()
            || self.usb.as_ref().is_some_and(Binding::keeps_up)
    }

    /// Handles the events of a USB host.
    fn work_off_usb(&mut self, now_ns: u64) {
        let Some(usb) = &mut self.usb else {
            return;
        };
        for event in usb.work_off(self.machine.firmware_mut(), now_ns) {
            match event {
                PortEvent::Data(bytes) => {
                    self.reply_to_usb = true;
                    self.bytes.0 += bytes.len() as u64;
                    self.tap.sent(Channel::Usb, &bytes, now_ns);
                    let streaming = self.attended();
                    self.machine.firmware_mut().set_streaming(streaming, now_ns);
                    self.machine.receive(&bytes, now_ns);
                }
                // The client of the pty is not affected.
                PortEvent::HungUp if self.reply_to_usb => {
                    self.tap.left(Channel::Usb, now_ns);
                    self.machine.hang_up();
                }
                PortEvent::HungUp => continue,
            }
        }
    }

    /// Sets the time at which an unfinished data block is abandoned.
    fn watch_block(&mut self) {
        if !self.machine.inside_block() {
            self.stall = None;
        } else if self.stall.is_none() || self.machine.taken_in() != self.stalled_at {
            self.stalled_at = self.machine.taken_in();
            self.stall = Some(Instant::now() + STALL);
        }
    }

    /// Delivers the frames that are due to the readers.
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

    /// Delivers a frame to all readers.
    fn deliver(&mut self, frame: &Arc<Frame>, wall: Duration) -> Result<()> {
        let firmware = self.machine.firmware();
        self.tap.frame(frame, firmware, self.seat.now_ns());
        if let Some(usb) = &self.usb {
            usb.put(frame, wall);
            if usb.lost() > 0 && !self.usb_lost {
                self.usb_lost = true;
                self.notice.tell(&format!(
                    "the USB host reads too slowly: frame {} is lost; reported only once",
                    frame.id
                ));
            }
        }
        if let Some(video) = &self.video
            && video.put(frame)? == Put::Lost
        {
            self.lost += 1;
            if self.lost == 1 {
                self.notice.tell(&format!(
                    "{} did not accept frame {}; reported only once",
                    video.address(),
                    frame.id
                ));
            }
        }
        self.camera.put(frame.clone());
        Ok(())
    }

    /// Passes exposures to the optics and replies to the port.
    fn dispatch(&mut self, now_ns: u64, wall: Duration) {
        // The result is not needed: `follow_others` notifies the operator of a rejected change.
        self.follow_others();
        for exposure in self.machine.take_exposures(now_ns) {
            let (firmware, version) = (self.machine.firmware(), self.version);
            self.history.push(&exposure.shot, firmware, version);
            let pattern_index = exposure.shot.pattern_index;
            let free_ns = firmware.stream().interval_ns;
            let start_ns = exposure.shot.start_ns;
            let interval = self.slowdown.interval(pattern_index, start_ns, free_ns);
            let free = pattern_index.is_none();
            let wanted = if free {
                self.keeps_up() && self.render_thread.backlog() < MAX_FREE_BACKLOG
            } else {
                self.attended()
            };
            if !wanted {
                self.machine.rendered(None, now_ns);
            } else {
                self.render_thread.expose(exposure, interval);
            }
        }
        if !self.pace.holds() {
            self.machine.frames_left();
        }
        let output = self.machine.take_output(now_ns);
        self.bytes.1 += output.len() as u64;
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
        // Even a timer of zero takes a millisecond.
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
