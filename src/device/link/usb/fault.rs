//! What may go wrong with a camera on USB, on purpose. A fault waits for the next frame and is over
//! with it; taking the device away is [`super::UsbDevice::unplug`].

use std::collections::VecDeque;
use std::time::Duration;

/// One fault of one frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The endpoint halts before the frame. The host has to clear it, which ends a bulk stream: the
    /// frames that wait are forgotten.
    Stall,
    /// The frame's payloads say that it is damaged; uvcvideo then flags the buffer.
    PayloadError,
    /// The frame ends in its middle.
    ShortFrame,
    /// The bit that toggles with each frame does not.
    FrozenFid,
    /// The frame waits for so long before it starts.
    Slow(Duration),
}

/// Faults that wait, the first for the next frame.
#[derive(Debug, Default)]
pub(super) struct Faults {
    waiting: VecDeque<Fault>,
}

impl Faults {
    /// Most that wait; more are forgotten.
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
