//! A whole device in memory with camera and port as an application opens them, on a virtual clock:
//! who waits for a frame or a reply lets device time pass, up to the timeout and no further, and
//! gets what came by then. So nothing takes longer than its computing, and every run is the same.

use phasmid_core::error::{Error, Result};
use phasmid_device::faults::Faults;
use phasmid_device::port::Port;
use phasmid_device::{Firmware, Machine, SerialLine, State};
use phasmid_host::{Camera, CommandPort};
use phasmid_profile::Profile;
use phasmid_protocol::Frame;
use phasmid_protocol::faults::{Schedule, Struck};
use phasmid_render::Renderer;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

/// How frames reach the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Link {
    /// With identity beside the pixels, as over the frame socket.
    Identified,
    /// Without, as over V4L2: a frame has a count and no more.
    Anonymous,
}

/// Frames that wait for the host; more are lost, the oldest first.
const QUEUE: usize = 64;
/// Steps at one moment of device time; a device that wants more hangs, and time goes on.
const STEPS: u32 = 1000;

/// The device and its clock.
pub struct Desk {
    machine: Machine,
    renderer: Renderer,
    now_ns: u64,
    link: Link,
    /// Somebody has the camera open.
    attended: bool,
    frames: VecDeque<Frame>,
    /// Frames that the link has carried.
    carried: u64,
    replies: VecDeque<u8>,
    /// The port has not gone since it was opened.
    plugged: bool,
}

impl Desk {
    /// Switches a device on. The renderer is that of the profile.
    ///
    /// # Errors
    /// A profile whose sequences cannot be read.
    pub fn new(
        profile: &Profile,
        renderer: Renderer,
        port: Port,
        link: Link,
        schedule: &Schedule,
    ) -> Result<Self> {
        let faults = Faults::new(schedule, &profile.name);
        let firmware = Firmware::new(profile, &[])?;
        Ok(Self {
            machine: Machine::new(firmware, port, SerialLine::default(), faults),
            renderer,
            now_ns: 0,
            link,
            attended: false,
            frames: VecDeque::new(),
            carried: 0,
            replies: VecDeque::new(),
            plugged: true,
        })
    }

    /// What has struck, and the renderer for the next device.
    pub fn into_parts(self) -> (Vec<Struck>, Renderer) {
        let struck = self.machine.faults().struck().cloned().collect();
        (struck, self.renderer)
    }

    /// Lets what is due happen.
    fn step(&mut self) {
        let now = self.now_ns;
        let machine = &mut self.machine;
        machine.firmware_mut().set_streaming(self.attended, now);
        machine.advance(now);
        for exposure in machine.take_exposures(now) {
            let frame = self.attended.then(|| {
                let frame = self.renderer.expose(&exposure.shot);
                Arc::new(exposure.readout.read(frame))
            });
            machine.rendered(frame, now);
        }
        while let Some(frame) = machine.next_frame(now) {
            self.carried += 1;
            if !self.attended {
                continue;
            }
            if self.frames.len() == QUEUE {
                self.frames.pop_front();
            }
            self.frames.push_back(match self.link {
                Link::Identified => Arc::unwrap_or_clone(frame),
                Link::Anonymous => Frame {
                    id: self.carried,
                    pattern_index: None,
                    exposure_start_ns: 0,
                    exposure_end_ns: 0,
                    ..Arc::unwrap_or_clone(frame)
                },
            });
        }
        machine.frames_left();
        self.replies.extend(machine.take_output(now));
        if !machine.connected(now) {
            self.plugged = false;
            self.replies.clear();
        }
    }

    /// Lets time pass until something has come, as `come` says, or the timeout is over.
    fn wait(&mut self, timeout: Duration, come: impl Fn(&Self) -> bool) {
        let wait_ns = u64::try_from(timeout.as_nanos()).unwrap_or(u64::MAX);
        let end_ns = self.now_ns.saturating_add(wait_ns);
        let mut steps = 0;
        loop {
            self.step();
            if come(self) || self.now_ns >= end_ns {
                return;
            }
            let free = matches!(self.machine.firmware().state(), State::Free { .. });
            let next = self.machine.next_event_ns(free && !self.attended);
            let next = next.map_or(end_ns, |next| next.clamp(self.now_ns, end_ns));
            steps = if next > self.now_ns { 0 } else { steps + 1 };
            self.now_ns = if steps < STEPS { next } else { end_ns };
        }
    }
}

/// The camera's end.
pub struct DeskCamera(Rc<RefCell<Desk>>);

impl DeskCamera {
    /// Opens the camera: from now on somebody reads.
    pub fn open(desk: &Rc<RefCell<Desk>>) -> Self {
        desk.borrow_mut().attended = true;
        Self(desk.clone())
    }
}

impl Drop for DeskCamera {
    fn drop(&mut self) {
        let mut desk = self.0.borrow_mut();
        desk.attended = false;
        desk.frames.clear();
    }
}

impl Camera for DeskCamera {
    fn info(&self) -> &str {
        "camera on the desk"
    }

    fn next_frame(&mut self, timeout: Duration) -> Result<Option<Frame>> {
        let mut desk = self.0.borrow_mut();
        if desk.frames.is_empty() {
            desk.wait(timeout, |desk| !desk.frames.is_empty());
        }
        Ok(desk.frames.pop_front())
    }

    fn identifies(&self) -> bool {
        self.0.borrow().link == Link::Identified
    }
}

/// The port's end.
pub struct DeskPort(Rc<RefCell<Desk>>);

impl DeskPort {
    /// Opens the port.
    pub fn open(desk: &Rc<RefCell<Desk>>) -> Self {
        Self(desk.clone())
    }
}

fn gone() -> Error {
    Error::device("port on the desk: the device has gone")
}

impl CommandPort for DeskPort {
    fn info(&self) -> &str {
        "port on the desk"
    }

    fn send(&mut self, bytes: &[u8], _timeout: Duration) -> Result<()> {
        let mut desk = self.0.borrow_mut();
        desk.step();
        if !desk.plugged {
            return Err(gone());
        }
        let now = desk.now_ns;
        desk.machine.receive(bytes, now);
        desk.step();
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize> {
        let mut desk = self.0.borrow_mut();
        if desk.replies.is_empty() {
            desk.wait(timeout, |desk| !desk.replies.is_empty() || !desk.plugged);
        }
        if !desk.plugged {
            return Err(gone());
        }
        let len = buffer.len().min(desk.replies.len());
        for (to, byte) in buffer.iter_mut().zip(desk.replies.drain(..len)) {
            *to = byte;
        }
        Ok(len)
    }

    fn reopen(&mut self, timeout: Duration) -> Result<()> {
        let mut desk = self.0.borrow_mut();
        desk.wait(timeout, |desk| desk.machine.connected(desk.now_ns));
        let now = desk.now_ns;
        if !desk.machine.connected(now) {
            return Err(gone());
        }
        desk.plugged = true;
        Ok(())
    }
}
