//! A complete device in memory, with camera and port as an application opens them, on a virtual clock.
//! Waiting for a frame or a reply advances device time until the frame or reply arrives, or up to the
//! timeout. A run therefore takes only its computing time, and is reproducible.

use phasmid_core::error::{Error, Result};
use phasmid_device::{Bench, Device, FrameSink, State};
use phasmid_host::{Camera, CommandPort};
use phasmid_protocol::Frame;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// How frames reach the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Link {
    /// Frames with identity beside the pixels, as over the frame socket.
    Identified,
    /// Frames without identity, as over V4L2: frames are only counted.
    Anonymous,
}

/// Maximum number of frames that wait for the host; beyond it, the oldest are lost.
const QUEUE: usize = 64;
/// Maximum number of steps at one device time; beyond it the device counts as hanging, and time
/// advances.
const STEPS: u32 = 1000;

/// A device with camera, port and clock. Clones share the device.
#[derive(Clone)]
pub struct Desk(Arc<Mutex<OnDesk>>);

struct OnDesk {
    bench: Bench<Queue>,
    replies: VecDeque<u8>,
    /// Whether the port has stayed connected since it was opened.
    plugged: bool,
}

/// Frames on their way to the host.
struct Queue {
    link: Link,
    /// Whether the camera is open.
    attended: bool,
    frames: VecDeque<Frame>,
    /// Number of frames that the link has carried.
    carried: u64,
}

impl FrameSink for Queue {
    fn attended(&self) -> bool {
        self.attended
    }

    fn put(&mut self, frame: Arc<Frame>) {
        self.carried += 1;
        if !self.attended {
            return;
        }
        if self.frames.len() == QUEUE {
            self.frames.pop_front();
        }
        let frame = Arc::unwrap_or_clone(frame);
        self.frames.push_back(match self.link {
            Link::Identified => frame,
            Link::Anonymous => Frame {
                id: self.carried,
                pattern_index: None,
                exposure_start_ns: 0,
                exposure_end_ns: 0,
                ..frame
            },
        });
    }
}

impl Desk {
    /// Puts a device on the desk, where a camera and a port can be opened.
    pub fn new(device: Device, link: Link) -> Self {
        let queue = Queue {
            link,
            attended: false,
            frames: VecDeque::new(),
            carried: 0,
        };
        Self(Arc::new(Mutex::new(OnDesk {
            bench: device.bench(queue),
            replies: VecDeque::new(),
            plugged: true,
        })))
    }

    /// Opens the camera; frames are delivered from now on.
    pub fn camera(&self) -> DeskCamera {
        self.lock().bench.sink.attended = true;
        DeskCamera(self.clone())
    }

    /// Opens the port.
    pub fn port(&self) -> DeskPort {
        DeskPort(self.clone())
    }

    /// Sends bytes to the control port, advances time until no operation is pending and returns the
    /// device's output.
    pub fn control(&self, bytes: &[u8]) -> Vec<u8> {
        self.lock().bench.control(bytes)
    }

    /// Returns the device time in nanoseconds.
    pub fn now_ns(&self) -> u64 {
        self.lock().bench.now_ns()
    }

    /// Advances to `ns` of device time.
    pub fn run_until(&self, ns: u64) {
        self.lock().bench.run_until(ns);
    }

    /// Calls a function with the device.
    pub fn with<T>(&self, then: impl FnOnce(&mut Device) -> T) -> T {
        then(self.lock().bench.device_mut())
    }

    /// Takes the device off the desk, unless a camera, a port or a clone still exists.
    pub fn into_device(self) -> Option<Device> {
        let state = Arc::into_inner(self.0)?.into_inner();
        Some(
            state
                .unwrap_or_else(PoisonError::into_inner)
                .bench
                .into_device(),
        )
    }

    /// Locks the desk. The lock may be poisoned by a panicked thread; the device's state is still
    /// consistent.
    fn lock(&self) -> MutexGuard<'_, OnDesk> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl OnDesk {
    /// Processes all events that are due.
    fn step(&mut self) {
        self.bench.run_until(self.bench.now_ns());
        self.replies.extend(self.bench.take_output());
        if !self.bench.machine().connected(self.bench.now_ns()) {
            self.plugged = false;
            self.replies.clear();
        }
    }

    /// Advances time until `come` returns true or the timeout is over.
    fn wait(&mut self, timeout: Duration, come: impl Fn(&Self) -> bool) {
        let wait_ns = u64::try_from(timeout.as_nanos()).unwrap_or(u64::MAX);
        let end_ns = self.bench.now_ns().saturating_add(wait_ns);
        let mut steps = 0;
        loop {
            self.step();
            let now = self.bench.now_ns();
            if come(self) || now >= end_ns {
                return;
            }
            let machine = self.bench.machine();
            let free = matches!(machine.firmware().state(), State::Free { .. });
            let next = machine.next_event_ns(free && !self.bench.sink.attended);
            let next = next.map_or(end_ns, |next| next.clamp(now, end_ns));
            steps = if next > now { 0 } else { steps + 1 };
            self.bench
                .run_until(if steps < STEPS { next } else { end_ns });
        }
    }
}

/// The host's end of the camera.
pub struct DeskCamera(Desk);

impl Drop for DeskCamera {
    fn drop(&mut self) {
        let mut desk = self.0.lock();
        desk.bench.sink.attended = false;
        desk.bench.sink.frames.clear();
    }
}

impl Camera for DeskCamera {
    fn info(&self) -> &str {
        "camera on the desk"
    }

    fn next_frame(&mut self, timeout: Duration) -> Result<Option<Frame>> {
        let mut desk = self.0.lock();
        if desk.bench.sink.frames.is_empty() {
            desk.wait(timeout, |desk| !desk.bench.sink.frames.is_empty());
        }
        // If rendering was stopped meanwhile, the frame is invalid.
        desk.bench.device_mut().renderer.stop().check()?;
        Ok(desk.bench.sink.frames.pop_front())
    }

    fn identifies(&self) -> bool {
        self.0.lock().bench.sink.link == Link::Identified
    }
}

/// The host's end of the port.
pub struct DeskPort(Desk);

fn gone() -> Error {
    Error::device("port on the desk: the device was removed")
}

impl CommandPort for DeskPort {
    fn info(&self) -> &str {
        "port on the desk"
    }

    fn send(&mut self, bytes: &[u8], _timeout: Duration) -> Result<()> {
        let mut desk = self.0.lock();
        desk.step();
        if !desk.plugged {
            return Err(gone());
        }
        desk.bench.receive(bytes);
        desk.step();
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize> {
        let mut desk = self.0.lock();
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
        let mut desk = self.0.lock();
        desk.wait(timeout, |desk| {
            desk.bench.machine().connected(desk.bench.now_ns())
        });
        if !desk.bench.machine().connected(desk.bench.now_ns()) {
            return Err(gone());
        }
        desk.plugged = true;
        Ok(())
    }
}
