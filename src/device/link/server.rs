//! The loop that serves a device: commands in, replies and frames out, device time in between.
//! One thread runs it, the optics have their own.

use super::device::point;
use super::frame_socket::FrameSocket;
use super::history::History;
use super::optics::Optics;
use super::pace::Pace;
use super::pty::{Event, Pty};
use super::run_dir::CAMERA;
use super::service::ServiceSocket;
use super::stage::Stage;
use super::tap::Tap;
use super::timeline::{Seat, Wait};
use super::usb::{Binding, PortEvent};
use super::video::{Put, VideoOutput};
use crate::{FrameSink, Machine, State};
use phasmid_core::error::{Error, Result};
use phasmid_profile::RigPlace;
use phasmid_protocol::Frame;
use phasmid_protocol::record::Channel;
use std::future::Future;
use std::path::PathBuf;
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
/// What is overdue for longer than this is worked off at once, as it is when a machine has slept.
const MAX_LAG_NS: u64 = 1_000_000_000;

/// What serves a device.
pub(super) struct Server {
    pub(super) machine: Machine,
    pub(super) seat: Seat,
    /// When the last thing was due that has been worked off.
    pub(super) handled_ns: u64,
    pub(super) stage: Stage,
    /// Version of the scene that the optics see.
    pub(super) version: u64,
    pub(super) rig: RigPlace,
    pub(super) history: History,
    /// `*IDN?`.
    pub(super) name: String,
    /// Bytes that came over the control port, and that went out.
    pub(super) bytes: (u64, u64),
    pub(super) optics: Optics,
    /// `None` while the port is gone, as when a cable is pulled.
    pub(super) pty: Option<Pty>,
    /// What points to the pty.
    pub(super) control: PathBuf,
    pub(super) camera: FrameSocket,
    pub(super) video: Option<VideoOutput>,
    pub(super) usb: Option<Binding>,
    /// The last command came over USB, and so the replies go there; the end of a connection of the
    /// port's other end is none of that one's business.
    pub(super) reply_to_usb: bool,
    pub(super) pace: Pace,
    pub(super) notice: fn(&str),
    /// Frames that the V4L2 node did not take.
    pub(super) lost: u64,
    /// A USB host has missed frames.
    pub(super) usb_lost: bool,
    pub(super) service: ServiceSocket,
    /// Records what passes.
    pub(super) tap: Tap,
    /// When to give up on a block.
    pub(super) stall: Option<Instant>,
    /// Bytes that the device had taken in when the block last went on.
    pub(super) stalled_at: u64,
}

impl Server {
    /// Serves until `shutdown` is done; `wall` tells for how long the device has been on.
    pub(super) async fn run(
        mut self,
        wall: impl Fn() -> Duration,
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
            let crowded = self.optics.backlog() >= MAX_BACKLOG;
            let full = crowded || self.machine.crowded();
            let free = matches!(self.machine.firmware().state(), State::Free { .. });
            // The optics' next frame wakes the loop in these cases.
            let behind = crowded || free && self.optics.backlog() >= MAX_FREE_BACKLOG;
            let wait = Wait {
                next_ns: self.machine.next_event_ns(behind),
                limit_ns: self.machine.next_event_ns(false).filter(|_| behind),
                settled: self.optics.backlog() == 0 && !self.pace.holds(),
            };
            tokio::select! {
                biased;
                () = &mut shutdown => return Ok(()),
                frame = self.optics.next(), if !self.pace.holds() => {
                    let frame = frame?;
                    let now = self.now();
                    self.machine.rendered(Some(frame), now);
                }
                frame = self.pace.due() => self.deliver(&frame, wall())?,
                changed = self.camera.changed() => {
                    changed.map_err(|e| Error::io(CAMERA, e))?;
                    self.camera.accept(self.machine.firmware().next_id());
                    self.tap.cameras(self.camera.counts(), self.seat.now_ns());
                }
                event = next_of(self.pty.as_mut()), if !full => {
                    // Who connected before the command was sent gets the frames that it causes,
                    // whichever of the two this loop noticed first.
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
                // After the ports: what was sent there before is older than what is asked here.
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

    /// Device time, up to which what was due has been worked off, each at its own time.
    fn now(&mut self) -> u64 {
        let now_ns = self.seat.now_ns();
        while let Some(due_ns) = self.machine.next_event_ns(false)
            && due_ns <= now_ns
            // What takes more than time to go on does so elsewhere.
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

    /// Takes over what has been placed since the last time. What comes back tells when the optics
    /// have done so, or why they have not.
    pub(super) fn follow(&mut self) -> Option<oneshot::Receiver<Result<()>>> {
        let (placements, version) = self.stage.since(self.version);
        self.version = version;
        let mut last = None;
        for placement in placements {
            let (sender, placed) = oneshot::channel();
            self.optics.place(placement, sender);
            last = Some(placed);
        }
        last
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
                    self.bytes.0 += bytes.len() as u64;
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
        self.tap.frame(frame, self.seat.now_ns());
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
        // A place that the optics refuse is told where it was asked for.
        let _ = self.follow();
        for exposure in self.machine.take_exposures(now_ns) {
            let (firmware, version) = (self.machine.firmware(), self.version);
            self.history.push(&exposure.shot, firmware, version);
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
