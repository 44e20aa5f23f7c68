//! The camera's endpoint: a queue of transfers that wait for frames, a queue of frames that wait for
//! transfers, and faults that can be injected. Each fault affects only one frame. To unplug the
//! device, see [`super::UsbDevice::unplug`].

use super::outgoing::Outgoing;
use phasmid_protocol::Frame;
use phasmid_protocol::usb::usbip::{Packet, Submit, status};
use phasmid_protocol::usb::uvc::payload;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

/// Maximum number of frames queued for the host; the memory of a physical device is limited too.
const MAX_FRAMES: usize = 1024;
/// Maximum number of frames of a free-running camera queued for the host: a slower host gets only
/// the newest frames.
const MAX_FREE_FRAMES: usize = 8;
/// Maximum total size in bytes of the frames queued for the host.
const MAX_BYTES: usize = 256 << 20;
/// Duration of an isochronous packet: one microframe.
const PACKET_TIME: Duration = Duration::from_micros(125);

/// A fault that affects a single frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The endpoint halts before the frame. The host has to clear the halt, which ends a bulk stream
    /// and discards the queued frames.
    Stall,
    /// The payload headers of the frame have the error bit set; uvcvideo then flags the buffer as
    /// faulty.
    PayloadError,
    /// The frame ends after half its bytes.
    ShortFrame,
    /// The frame identifier bit (FID), which should toggle with each frame, does not toggle.
    FrozenFid,
    /// The frame starts later by this time.
    Slow(Duration),
}

/// Faults queued for coming frames; the first applies to the next frame.
#[derive(Debug, Default)]
pub(super) struct Faults {
    waiting: VecDeque<Fault>,
}

impl Faults {
    /// Maximum number of queued faults; further faults are ignored.
    const MAX: usize = 1024;

    pub(super) fn push(&mut self, fault: Fault) {
        if self.waiting.len() < Self::MAX {
            self.waiting.push_back(fault);
        }
    }

    pub(super) fn next(&mut self) -> Option<Fault> {
        self.waiting.pop_front()
    }
}

/// A pending transfer.
struct Waiting {
    submit: Submit,
    /// Packets of the transfer if it is isochronous.
    packets: Vec<Packet>,
    /// Time at which the transfer, if isochronous, completes, whether or not a frame is available.
    due: Duration,
}

/// The frame being sent.
struct Current {
    frame: Arc<Frame>,
    /// Number of bytes of the frame sent so far.
    at: usize,
    /// Number of bytes of the frame to send; less than the frame's size if a fault truncates the
    /// frame.
    len: usize,
    /// Bits of the frame's payload headers, except the end-of-frame bit.
    info: u8,
}

/// State of the camera's endpoint.
#[derive(Default)]
pub(super) struct Video {
    waiting: VecDeque<Waiting>,
    frames: VecDeque<Arc<Frame>>,
    bytes: usize,
    current: Option<Current>,
    fid: u8,
    pub(super) faults: Faults,
    /// Earliest start time of the next frame.
    not_before: Duration,
    /// Completion time of the isochronous transfer that was submitted last.
    last_due: Duration,
    /// Whether a host reads frames.
    pub(super) started: bool,
}

impl Video {
    /// Queues a transfer from the host.
    pub(super) fn submit(&mut self, submit: Submit, packets: &[Packet], now: Duration) {
        let time = PACKET_TIME * packets.len() as u32;
        self.last_due = self.last_due.max(now) + time;
        self.waiting.push_back(Waiting {
            submit,
            packets: packets.to_vec(),
            due: self.last_due,
        });
    }

    /// Cancels a transfer. Returns `false` if the transfer is not pending.
    pub(super) fn unlink(&mut self, seqnum: u32) -> bool {
        let before = self.waiting.len();
        self.waiting
            .retain(|waiting| waiting.submit.seqnum != seqnum);
        // The time slot of a cancelled transfer is free again.
        self.last_due = self.waiting.back().map_or(Duration::ZERO, |w| w.due);
        self.waiting.len() < before
    }

    /// Returns the number of pending transfers.
    pub(super) fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// Returns the number of isochronous packets in pending transfers.
    pub(super) fn packets(&self) -> usize {
        let packets = self.waiting.iter().map(|waiting| waiting.packets.len());
        packets.sum()
    }

    /// Fails all pending transfers because the endpoint is halted.
    pub(super) fn stall(&mut self, outgoing: &mut Outgoing) {
        for waiting in self.waiting.drain(..) {
            outgoing.failed(&waiting.submit, &waiting.packets, status::STALL);
        }
    }

    /// Returns whether as many frames are queued as a free-running camera may queue.
    pub(super) fn is_crowded(&self) -> bool {
        self.frames.len() >= MAX_FREE_FRAMES
    }

    /// Queues a frame. Returns `false` if memory is full and the frame is therefore lost. For a
    /// free-running camera, drops the oldest frame if too many are queued; this does not count as a
    /// loss.
    pub(super) fn put(&mut self, frame: Arc<Frame>) -> bool {
        let len = frame.data.len();
        let is_free = |frame: &Frame| frame.pattern_index.is_none();
        if is_free(&frame)
            && self.is_crowded()
            && let Some(oldest) = self.frames.iter().position(|waiting| is_free(waiting))
            && let Some(gone) = self.frames.remove(oldest)
        {
            self.bytes -= gone.data.len();
        }
        if self.frames.len() >= MAX_FRAMES || self.bytes + len > MAX_BYTES {
            return false;
        }
        self.bytes += len;
        self.frames.push_back(frame);
        true
    }

    /// Ends the stream: discards its queued frames but keeps pending transfers.
    pub(super) fn stop(&mut self) {
        self.started = false;
        self.frames.clear();
        self.bytes = 0;
        self.current = None;
        self.not_before = Duration::ZERO;
    }

    /// Resets the endpoint and discards pending transfers when the device is detached.
    pub(super) fn reset(&mut self) {
        self.stop();
        self.waiting.clear();
        self.fid = 0;
        self.last_due = Duration::ZERO;
    }

    /// Returns the time of the next action that happens without a command or a frame.
    pub(super) fn next_due(&self) -> Option<Duration> {
        let slow = self.not_before;
        let delayed = !self.frames.is_empty() && slow > Duration::ZERO && self.current.is_none();
        let waiting = self.waiting.front()?;
        match waiting.submit.packets {
            Some(_) => Some(waiting.due),
            None => delayed.then_some(slow),
        }
    }

    /// Completes all transfers that can complete now, in payloads of up to `max_payload` bytes.
    /// Returns `true` if the endpoint must halt.
    pub(super) fn pump(
        &mut self,
        max_payload: usize,
        now: Duration,
        outgoing: &mut Outgoing,
    ) -> bool {
        while let Some(waiting) = self.waiting.front() {
            if waiting.submit.packets.is_some() {
                if waiting.due > now {
                    return false;
                }
                if self.begin(now) {
                    return true;
                }
                if let Some(waiting) = self.waiting.pop_front() {
                    self.isochronous(&waiting, now, outgoing);
                }
                continue;
            }
            // The transfer is too small for a payload header: report an overflow, like babble on a
            // real bus.
            if (waiting.submit.length as usize) < payload::HEADER_LEN {
                outgoing.received(waiting.submit.seqnum, status::OVERFLOW, 0);
                self.waiting.pop_front();
                continue;
            }
            if self.begin(now) {
                return true;
            }
            let Some(mut current) = self.current.take() else {
                return false;
            };
            let Some(waiting) = self.waiting.pop_front() else {
                return false;
            };
            let room = max_payload.min(waiting.submit.length as usize) - payload::HEADER_LEN;
            let (info, part) = current.next(room);
            let ended = info & payload::EOF != 0;
            outgoing.payload(waiting.submit.seqnum, info, &current.frame, part);
            self.current = (!ended).then_some(current);
        }
        false
    }

    /// Makes the next queued frame the current one unless a frame is already being sent. Returns
    /// `true` if a stall occurs in place of the frame.
    fn begin(&mut self, now: Duration) -> bool {
        if self.current.is_some() || self.frames.is_empty() || now < self.not_before {
            return false;
        }
        let fault = if self.not_before > Duration::ZERO {
            // The delay of a slow frame has passed, so the frame starts now.
            self.not_before = Duration::ZERO;
            None
        } else {
            self.faults.next()
        };
        match fault {
            Some(Fault::Stall) => return true,
            Some(Fault::Slow(time)) => {
                self.not_before = now + time;
                return false;
            }
            _ => {}
        }
        let Some(frame) = self.frames.pop_front() else {
            return false;
        };
        self.bytes -= frame.data.len();
        if fault != Some(Fault::FrozenFid) {
            self.fid ^= payload::FID;
        }
        let whole = frame.data.len();
        let damaged = fault == Some(Fault::PayloadError);
        self.current = Some(Current {
            at: 0,
            len: if fault == Some(Fault::ShortFrame) {
                whole / 2
            } else {
                whole
            },
            info: payload::EOH | self.fid | if damaged { payload::ERR } else { 0 },
            frame,
        });
        false
    }

    /// Completes one isochronous transfer. Its packets are empty while there is no frame; a frame
    /// may begin in any packet.
    fn isochronous(&mut self, waiting: &Waiting, now: Duration, outgoing: &mut Outgoing) {
        let mut parts = Vec::with_capacity(waiting.packets.len());
        let mut packets = waiting.packets.clone();
        let mut actual = 0;
        for packet in &mut packets {
            packet.status = status::OK;
            packet.actual = 0;
            if (packet.length as usize) < payload::HEADER_LEN {
                continue;
            }
            if self.current.is_none() {
                // A stall that occurs within a transfer takes effect at the next transfer.
                let _ = self.begin(now);
            }
            let room = packet.length as usize - payload::HEADER_LEN;
            let Some(mut current) = self.current.take() else {
                continue;
            };
            let (info, part) = current.next(room);
            packet.actual = (payload::HEADER_LEN + part.len()) as u32;
            actual += packet.actual;
            parts.push((info, current.frame.clone(), part));
            self.current = (info & payload::EOF == 0).then_some(current);
        }
        outgoing.isochronous(waiting.submit.seqnum, actual, packets.len() as u32);
        for (info, frame, part) in parts {
            outgoing.packet(info, &frame, part);
        }
        outgoing.packets(&packets);
    }
}

impl Current {
    /// Returns the header bits of the next payload and the range of the frame that it carries, at
    /// most `room` bytes.
    fn next(&mut self, room: usize) -> (u8, std::ops::Range<usize>) {
        let end = (self.at + room).min(self.len);
        let part = self.at..end;
        self.at = end;
        let last = if end == self.len { payload::EOF } else { 0 };
        (self.info | last, part)
    }
}

#[cfg(test)]
mod tests;
