//! What a replayed device will do, read ahead of its time.

use phasmid_protocol::Frame;
use std::collections::VecDeque;
use std::sync::Arc;

/// What is read ahead of its time, in pieces and in bytes; at least one piece.
pub(super) const MAX_AHEAD: (usize, usize) = (256, 64 << 20);

/// What the device does.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Output {
    /// Sends bytes on the control port.
    Bytes(Vec<u8>),
    /// Has a frame.
    Frame(Arc<Frame>),
    /// Has a frame that does not say which it is, taken at a time of the replay.
    Counted(Arc<Frame>, u64),
    /// Takes its end away.
    Gone(End),
    /// Puts it back.
    Back(End),
}

/// An end of the device's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum End {
    /// Of the control port.
    Port,
    /// Of the camera.
    Camera,
}

impl Output {
    fn len(&self) -> usize {
        match self {
            Self::Bytes(bytes) => bytes.len(),
            Self::Frame(frame) | Self::Counted(frame, _) => frame.data.len(),
            Self::Gone(_) | Self::Back(_) => 0,
        }
    }
}

/// Something that the device will do.
pub(super) struct Due {
    due_ns: u64,
    pub(super) output: Output,
    /// Session in which it did so.
    pub(super) session: u64,
}

/// All of it, in the order in which it happens.
#[derive(Default)]
pub(super) struct Ahead {
    queue: VecDeque<Due>,
    bytes: usize,
    last_due_ns: u64,
}

impl Ahead {
    /// Enough is read ahead.
    pub(super) fn is_full(&self) -> bool {
        self.len() >= MAX_AHEAD.0 || self.bytes >= MAX_AHEAD.1
    }

    /// In how many pieces it is.
    pub(super) fn len(&self) -> usize {
        self.queue.len()
    }

    /// Puts what happens behind all others, at this time at the earliest.
    pub(super) fn put(&mut self, due_ns: u64, output: Output, session: u64) {
        self.last_due_ns = self.last_due_ns.max(due_ns);
        self.bytes += output.len();
        self.queue.push_back(Due {
            due_ns: self.last_due_ns,
            output,
            session,
        });
    }

    /// Takes what happens next.
    pub(super) fn take(&mut self) -> Option<Due> {
        let due = self.queue.pop_front()?;
        self.bytes -= due.output.len();
        Some(due)
    }

    /// When that is.
    pub(super) fn next_ns(&self) -> Option<u64> {
        self.queue.front().map(|due| due.due_ns)
    }

    /// Forgets it; ends that have gone still come back.
    pub(super) fn forget(&mut self) {
        let back = |end| {
            let mut queue = self.queue.iter().rev();
            let due = queue.find(|due| due.output == Output::Back(end));
            due.map(|due| (due.due_ns, due.session, end))
        };
        let mut kept: Vec<_> = [End::Port, End::Camera]
            .into_iter()
            .filter_map(back)
            .collect();
        kept.sort_by_key(|(due_ns, ..)| *due_ns);
        self.queue.clear();
        self.queue
            .extend(kept.into_iter().map(|(due_ns, session, end)| Due {
                due_ns,
                output: Output::Back(end),
                session,
            }));
        self.bytes = 0;
    }
}
