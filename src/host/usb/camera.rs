//! The camera of a USB device: agrees on a stream, keeps transfers under way, gives frames.
//!
//! Pixels go from the socket straight into the frame that is handed out; when the frames that wait
//! have no reader, no transfers are submitted, and the device has to wait.

use super::connection::{Done, Receiver, Shared, lock};
use super::controls::{ControlState, VideoControl};
use super::device::UsbDevice;
use super::feed::{Feed, Flow};
use super::frames::{Assembler, Event};
use super::negotiation::{Carrier, agree};
use super::transfer::transfer_like;
use super::video::{VideoFunction, VideoMode};
use crate::Camera;
use crate::clock::monotonic_ns;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::Frame;
use phasmid_protocol::usb::usbip::{Submit, status};
use std::collections::VecDeque;
use std::io::{self, Read};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Frames that wait for their reader before the device has to.
const MAX_READY: usize = 4;
/// Transfers under way, of some 16 to 64 KiB each.
const DEPTH: usize = 32;
/// Buffers kept for frames to come.
const MAX_SPARE: usize = MAX_READY + 2;

/// A UVC camera. Its frames are what the device sends: they have no identity but their
/// number, and the time at which they were whole; a damaged one leaves a gap in the numbers.
pub struct UsbCamera {
    feed: Feed,
    queue: Arc<Queue>,
    function: VideoFunction,
    mode: VideoMode,
    carrier: Carrier,
    /// Frames so far, the damaged ones among them.
    count: u64,
    skipped: bool,
}

/// What waits for the reader.
#[derive(Debug)]
struct Queue {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug)]
struct State {
    flow: Flow,
    /// What has come, and when on the system's monotonic clock, in nanoseconds.
    ready: VecDeque<(Event, u64)>,
    spare: Vec<Vec<u8>>,
}

impl State {
    /// Transfers to submit now.
    fn more(&mut self) -> usize {
        self.flow.more(self.ready.len() < MAX_READY)
    }
}

/// Takes transfers to frames.
struct Stream {
    assembler: Assembler,
    queue: Arc<Queue>,
    last: Option<u32>,
}

impl UsbCamera {
    /// Starts the camera in a mode, or in its first one.
    ///
    /// # Errors
    /// A device without a camera that can be read here, or one that agrees on nothing.
    pub fn open(device: &Arc<UsbDevice>, mode: Option<&VideoMode>) -> Result<Self> {
        let function = VideoFunction::find(device.configuration())
            .map_err(|what| Error::device(format!("{}: {what}", device.place())))?;
        let mode = mode.unwrap_or(&function.modes[0]).clone();
        let carrier = agree(device, &function, &mode)?;
        let queue = Arc::new(Queue {
            state: Mutex::new(State {
                flow: Flow::new(DEPTH),
                ready: VecDeque::new(),
                spare: Vec::new(),
            }),
            changed: Condvar::new(),
        });
        let receiver: Shared = Arc::new(Mutex::new(Stream {
            assembler: Assembler::new(carrier.frame_len, carrier.max_payload),
            queue: Arc::clone(&queue),
            last: None,
        }));
        let like = Submit {
            packets: carrier.packets,
            interval: u32::from(carrier.packets.is_some()),
            ..transfer_like(carrier.address, carrier.transfer_len)
        };
        let camera = Self {
            feed: Feed {
                device: Arc::clone(device),
                like,
                receiver,
            },
            queue,
            function,
            mode,
            carrier,
            count: 0,
            skipped: false,
        };
        let first = lock(&camera.queue.state).more();
        camera.feed.submit(first)?;
        Ok(camera)
    }

    /// What the frames are like.
    pub fn mode(&self) -> &VideoMode {
        &self.mode
    }

    /// What the camera offers.
    pub fn function(&self) -> &VideoFunction {
        &self.function
    }

    /// Reads a control; `None` where the camera has none.
    ///
    /// # Errors
    /// A camera that refuses, is silent, or has gone.
    pub fn control(&self, control: VideoControl) -> Result<Option<ControlState>> {
        control.read(&self.feed.device, &self.function)
    }

    /// Sets a control.
    ///
    /// # Errors
    /// A camera without it, one that refuses the value, is silent, or has gone.
    pub fn set_control(&self, control: VideoControl, to: u32) -> Result<()> {
        control.write(&self.feed.device, &self.function, to)
    }

    /// Gives the pixels of a frame back that nobody needs any more: the memory is used again.
    pub fn give_back(&self, buffer: Vec<u8>) {
        let mut state = lock(&self.queue.state);
        if state.spare.len() < MAX_SPARE {
            state.spare.push(buffer);
        }
    }

    fn frame(&self, data: Vec<u8>, time_ns: u64) -> Frame {
        Frame {
            id: self.count,
            pattern_index: None,
            width: self.mode.width,
            height: self.mode.height,
            format: self.mode.format,
            exposure_start_ns: time_ns,
            exposure_end_ns: time_ns,
            data,
        }
    }

    fn take(&mut self, (event, time_ns): (Event, u64)) -> Result<Frame> {
        self.count += 1;
        match event {
            Event::Frame(data) => Ok(self.frame(data, time_ns)),
            Event::Damaged(why) => {
                self.skipped = true;
                let count = self.count;
                Err(Error::device(format!(
                    "{}: frame {count}: {why}",
                    self.info()
                )))
            }
        }
    }

    /// Ends the stream as drivers do: takes the transfers back, then tells the device.
    fn stop(&mut self) -> Result<()> {
        lock(&self.queue.state).flow.closing = true;
        self.feed.take_back()?;
        match self.carrier.packets {
            None => self.feed.device.clear_halt(self.carrier.address),
            Some(_) => self.feed.device.set_interface(self.function.streaming, 0),
        }
    }
}

impl Camera for UsbCamera {
    fn info(&self) -> &str {
        self.feed.device.place()
    }

    fn next_frame(&mut self, timeout: Duration) -> Result<Option<Frame>> {
        self.skipped = false;
        let deadline = Instant::now() + timeout;
        let queue = Arc::clone(&self.queue);
        let mut state = lock(&queue.state);
        loop {
            let event = state.ready.pop_front();
            // With the lock in hand nobody could read what the device sends meanwhile.
            if event.is_none() && state.flow.halted {
                drop(state);
                self.feed.device.clear_halt(self.carrier.address)?;
                state = lock(&queue.state);
                state.flow.halted = false;
            }
            let more = state.more();
            if more > 0 {
                drop(state);
                self.feed.submit(more)?;
                state = lock(&queue.state);
            }
            if let Some(event) = event {
                drop(state);
                return self.take(event).map(Some);
            }
            if !state.ready.is_empty() {
                continue;
            }
            if state.flow.gone {
                return Err(self.feed.device.client().connection().error());
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            state = queue
                .changed
                .wait_timeout(state, left)
                .unwrap_or_else(PoisonError::into_inner)
                .0;
        }
    }

    fn has_skipped(&self) -> bool {
        self.skipped
    }

    fn identifies(&self) -> bool {
        false
    }
}

impl Drop for UsbCamera {
    fn drop(&mut self) {
        // A device that has gone needs no farewell.
        let _ = self.stop();
    }
}

impl Receiver for Stream {
    fn reply(&mut self, done: &Done, data: &mut dyn Read) -> io::Result<usize> {
        // An endpoint's transfers end in order, but for those that were taken back; the difference
        // holds where numbers wrap.
        if done.status != status::UNLINKED {
            if let Some(last) = self.last
                && (done.seqnum.wrapping_sub(last) as i32) <= 0
            {
                let seqnum = done.seqnum;
                return Err(io::Error::other(format!(
                    "the server answers transfer {seqnum} of the camera after transfer {last}"
                )));
            }
            self.last = Some(done.seqnum);
        }
        let mut events = Vec::new();
        let mut out = |event| events.push(event);
        if done.packets.is_empty() {
            self.assembler
                .take(done.actual, done.length, data, &mut out)?;
        } else {
            for packet in &done.packets {
                // What belongs to the next packet stays for it.
                let mut part = data.take(packet.actual.into());
                if packet.status != status::OK {
                    self.assembler
                        .lose(format!("a packet has status {}", packet.status));
                } else {
                    self.assembler
                        .take(packet.actual as usize, usize::MAX, &mut part, &mut out)?;
                }
                io::copy(&mut part, &mut io::sink())?;
            }
        }
        let mut state = lock(&self.queue.state);
        if let Some(why) = state.flow.ended(done) {
            self.assembler.lose(why);
        }
        if state.flow.halted || !events.is_empty() {
            self.queue.changed.notify_one();
        }
        let now_ns = monotonic_ns();
        state
            .ready
            .extend(events.into_iter().map(|event| (event, now_ns)));
        if self.assembler.wants_buffer()
            && let Some(spare) = state.spare.pop()
        {
            self.assembler.supply(spare);
        }
        Ok(state.more())
    }

    fn gone(&mut self) {
        lock(&self.queue.state).flow.gone = true;
        self.queue.changed.notify_one();
    }
}
