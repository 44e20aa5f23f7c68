//! Log of faults that have struck, for operators and tests.

use phasmid_protocol::faults::Struck;
use std::collections::VecDeque;

/// Number of log entries kept; older ones are only counted.
const REMEMBERED: usize = 4096;
/// Maximum number of bytes of a command that are kept.
const COMMAND_BYTES: usize = 256;

/// The latest faults that have struck, and their total number.
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

/// Returns a message as text, with invalid UTF-8 marked and truncated to [`COMMAND_BYTES`].
pub(super) fn command(message: &[u8]) -> String {
    let end = message.len().min(COMMAND_BYTES);
    let text = String::from_utf8_lossy(&message[..end]);
    text.trim().to_owned()
}
