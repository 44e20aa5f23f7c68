//! Actions of a replayed device, read ahead of their time.

use phasmid_protocol::Frame;
use std::collections::VecDeque;
use std::sync::Arc;

/// Maximum number and maximum total size in bytes of the actions read ahead; one action is always
/// read.
pub(super) const MAX_AHEAD: (usize, usize) = (256, 64 << 20);

/// An action of the device.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Output {
    /// Sends bytes on the control port.
    Bytes(Vec<u8>),
    /// Sends a frame.
    Frame(Arc<Frame>),
    /// Sends a frame that carries no id and was taken at this time of the replay, in nanoseconds.
    Counted(Arc<Frame>, u64),
    /// Disconnects an end.
    Gone(End),
    /// Reconnects an end.
    Back(End),
}

/// An end of the device to which clients connect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum End {
    /// The control port.
    Port,
    /// The camera.
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

/// A scheduled action.
pub(super) struct Due {
    due_ns: u64,
    pub(super) output: Output,
    /// Number of the session to which the action belongs.
    pub(super) session: u64,
}

/// All scheduled actions, in order of their due times.
#[derive(Default)]
pub(super) struct Ahead {
    queue: VecDeque<Due>,
    bytes: usize,
    last_due_ns: u64,
}

impl Ahead {
    /// Returns whether the limits of [`MAX_AHEAD`] have been reached.
    pub(super) fn is_full(&self) -> bool {
        self.len() >= MAX_AHEAD.0 || self.bytes >= MAX_AHEAD.1
    }

    /// Returns the number of scheduled actions.
    pub(super) fn len(&self) -> usize {
        self.queue.len()
    }

    /// Appends an action that is due at `due_ns`, but not before the action ahead of it.
    pub(super) fn put(&mut self, due_ns: u64, output: Output, session: u64) {
        self.last_due_ns = self.last_due_ns.max(due_ns);
        self.bytes += output.len();
        self.queue.push_back(Due {
            due_ns: self.last_due_ns,
            output,
            session,
        });
    }

    /// Takes the next action.
    pub(super) fn take(&mut self) -> Option<Due> {
        let due = self.queue.pop_front()?;
        self.bytes -= due.output.len();
        Some(due)
    }

    /// Returns when the next action is due.
    pub(super) fn next_ns(&self) -> Option<u64> {
        self.queue.front().map(|due| due.due_ns)
    }

    /// Discards all actions except the reconnection of disconnected ends.
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
