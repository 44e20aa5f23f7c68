//! The camera of a USB device: negotiates a stream, keeps transfers in flight and returns frames.
//!
//! Pixels are read from the socket directly into the frame that is handed out. When the queue of
//! finished frames is full, no transfers are submitted, so the device has to wait.

use super::connection::{Done, Receiver, Shared, lock};
use super::controls::{ControlState, VideoControl};
use super::device::UsbDevice;
use super::feed::{Feed, Flow};
use super::frames::{Assembler, Event};
use super::negotiation::{Carrier, agree};
use super::transfer::transfer_like;
use super::video::{VideoFunction, VideoMode};
use crate::Camera;
use crate::time::monotonic_ns;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::Frame;
use phasmid_protocol::usb::usbip::{Submit, status};
use std::collections::VecDeque;
use std::io::{self, Read};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Maximum number of frames that wait for the reader before the device has to wait.
const MAX_READY: usize = 4;
/// Number of transfers in flight, each of some 16 to 64 KiB.
const DEPTH: usize = 32;
/// Number of buffers kept for future frames.
const MAX_SPARE: usize = MAX_READY + 2;

/// A UVC camera. Its frames do not identify themselves: they have only a running number and the
/// time at which they were complete. A damaged frame leaves a gap in the numbers.
pub struct UsbCamera {
    feed: Feed,
    queue: Arc<Queue>,
    function: VideoFunction,
    mode: VideoMode,
    carrier: Carrier,
    /// Number of frames so far, including damaged frames.
    count: u64,
    skipped: bool,
}

/// The queue of frames for the reader.
#[derive(Debug)]
struct Queue {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug)]
struct State {
    flow: Flow,
    /// Received events, each with its arrival time in nanoseconds on the system's monotonic clock.
    ready: VecDeque<(Event, u64)>,
    spare: Vec<Vec<u8>>,
}

impl State {
    /// Returns the number of transfers to submit now, and counts them as in flight.
    fn more(&mut self) -> usize {
        self.flow.more(self.ready.len() < MAX_READY)
    }
}

/// Assembles transfers into frames.
struct Stream {
    assembler: Assembler,
    queue: Arc<Queue>,
    last: Option<u32>,
}

impl UsbCamera {
    /// Starts the camera in the given mode, or in its first mode if `mode` is `None`.
    ///
    /// # Errors
    /// Returns an error if the device has no supported camera, or if the negotiation fails.
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

    /// Returns the mode in use.
    pub fn mode(&self) -> &VideoMode {
        &self.mode
    }

    /// Returns the video function: the camera's modes and controls.
    pub fn function(&self) -> &VideoFunction {
        &self.function
    }

    /// Reads a control; returns `None` if the camera does not have it.
    ///
    /// # Errors
    /// Returns an error if the camera refuses, does not answer, or is gone.
    pub fn control(&self, control: VideoControl) -> Result<Option<ControlState>> {
        control.read(&self.feed.device, &self.function)
    }

    /// Sets a control.
    ///
    /// # Errors
    /// Returns an error if the camera lacks the control, refuses the value, does not answer, or is
    /// gone.
    pub fn set_control(&self, control: VideoControl, to: u32) -> Result<()> {
        control.write(&self.feed.device, &self.function, to)
    }

    /// Gives back the buffer of a frame that the caller has finished with, so that its memory is
    /// reused.
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

    /// Stops the stream as kernel drivers do: unlinks the transfers, then tells the device.
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
            // Release the lock first, because the reader thread needs it while this thread clears
            // the halt.
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
        // An error here means that the device is gone, and the stream with it.
        let _ = self.stop();
    }
}

impl Receiver for Stream {
    fn reply(&mut self, done: &Done, data: &mut dyn Read) -> io::Result<usize> {
        // The transfers of an endpoint end in order, except unlinked ones. The wrapping difference
        // stays valid when sequence numbers wrap around.
        if done.status != status::UNLINKED {
            if let Some(last) = self.last
                && (done.seqnum.wrapping_sub(last) as i32) <= 0
            {
                let seqnum = done.seqnum;
                return Err(io::Error::other(format!(
                    "the server answered camera transfer {seqnum} out of order, after transfer \
                     {last}"
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
                // Limit the read to this packet's data.
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
