//! How long a scan may stay away before the beam is held.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Longer than anybody waits: what else there is to say has been said.
pub(super) const FOREVER: Duration = Duration::from_secs(365 * 24 * 3600);

/// Scans that tell how long one takes.
const USUAL: usize = 5;
/// A scan that has been away for so many times what the longest of the last ones took stays away.
const TIMES: u32 = 3;

/// The host's clock between scans. The device's says nothing while nothing comes, and a device that is
/// rendered may take longer for a scan than its own clock has it: so what is usual counts too.
pub(super) struct Patience {
    least: Duration,
    last: Option<Instant>,
    usual: VecDeque<Duration>,
}

impl Patience {
    /// Of a beam that is held when readings are so old.
    pub(super) fn new(least: Duration) -> Self {
        Self {
            least,
            last: None,
            usual: VecDeque::new(),
        }
    }

    /// A scan has come.
    pub(super) fn heard(&mut self) {
        let now = Instant::now();
        if let Some(last) = self.last.replace(now) {
            if self.usual.len() == USUAL {
                self.usual.pop_front();
            }
            self.usual.push_back(now - last);
        }
    }

    /// For how long the next may stay away yet; without end before there have been two.
    pub(super) fn left(&self) -> Duration {
        match (self.last, self.usual.iter().max()) {
            (Some(last), Some(longest)) => (*longest * TIMES)
                .max(self.least)
                .saturating_sub(last.elapsed()),
            _ => FOREVER,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_takes_long_is_waited_for_and_no_longer() {
        let mut patience = Patience::new(Duration::from_millis(40));
        assert_eq!(patience.left(), FOREVER);
        patience.heard();
        assert_eq!(patience.left(), FOREVER, "one tells no interval");
        patience.heard();
        assert!(patience.left() <= Duration::from_millis(40));
        std::thread::sleep(Duration::from_millis(60));
        assert_eq!(patience.left(), Duration::ZERO);
        patience.heard();
        let left = patience.left();
        assert!(
            left > Duration::from_millis(120),
            "three times 60 ms: {left:?}"
        );
        for _ in 0..USUAL {
            patience.heard();
        }
        assert!(
            patience.left() <= Duration::from_millis(40),
            "that is long ago"
        );
    }
}
