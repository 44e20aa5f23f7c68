//! What has struck, for whoever looks after the device and for tests.

use phasmid_protocol::faults::Struck;
use std::collections::VecDeque;

/// Faults that are remembered; older ones are only counted.
const REMEMBERED: usize = 4096;
/// Bytes of a command that are kept.
const COMMAND_BYTES: usize = 256;

/// The latest faults that have struck, and how many there have been.
#[derive(Debug, Clone, Default)]
pub(super) struct Log {
    latest: VecDeque<Struck>,
    total: u64,
}

impl Log {
    pub(super) fn push(&mut self, struck: Struck) {
        if self.latest.len() == REMEMBERED {
            self.latest.pop_front();
        }
        self.latest.push_back(struck);
        self.total += 1;
    }

    pub(super) fn latest(&self) -> impl DoubleEndedIterator<Item = &Struck> {
        self.latest.iter()
    }

    pub(super) fn total(&self) -> u64 {
        self.total
    }
}

/// A message as text: what is no UTF-8 is marked, and what is too long cut off.
pub(super) fn command(message: &[u8]) -> String {
    let end = message.len().min(COMMAND_BYTES);
    let text = String::from_utf8_lossy(&message[..end]);
    text.trim().to_owned()
}
