//! Faults that can be injected into a USB camera. Each fault affects the next frame only. To unplug
//! the device, see [`super::UsbDevice::unplug`].

use std::collections::VecDeque;
use std::time::Duration;

/// One fault of one frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The endpoint halts before the frame. The host has to clear it, which ends a bulk stream and
    /// discards the queued frames.
    Stall,
    /// The frame's payload headers have the error bit set; uvcvideo then flags the buffer.
    PayloadError,
    /// The frame ends after half its bytes.
    ShortFrame,
    /// The frame identifier bit (FID), which toggles with each frame, does not toggle.
    FrozenFid,
    /// The frame starts this much later.
    Slow(Duration),
}

/// Queued faults; the first applies to the next frame.
#[derive(Debug, Default)]
pub(super) struct Faults {
    waiting: VecDeque<Fault>,
}

impl Faults {
    /// Maximum number of queued faults; further ones are ignored.
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
