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
    pub(super) fn heard(&mut self, now: Instant) {
        if let Some(last) = self.last.replace(now) {
            if self.usual.len() == USUAL {
                self.usual.pop_front();
            }
            self.usual.push_back(now - last);
        }
    }

    /// For how long the next may stay away yet; without end before there have been two.
    pub(super) fn left(&self, now: Instant) -> Duration {
        match (self.last, self.usual.iter().max()) {
            (Some(last), Some(longest)) => (*longest * TIMES)
                .max(self.least)
                .saturating_sub(now - last),
            _ => FOREVER,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_takes_long_is_waited_for_and_no_longer() {
        let begin = Instant::now();
        let at = |ms: u64| begin + Duration::from_millis(ms);
        let ms = Duration::from_millis;
        let mut patience = Patience::new(ms(40));
        assert_eq!(patience.left(at(0)), FOREVER);
        patience.heard(at(0));
        assert_eq!(patience.left(at(5)), FOREVER, "one tells no interval");
        patience.heard(at(10));
        assert_eq!(patience.left(at(20)), ms(30));
        assert_eq!(patience.left(at(70)), Duration::ZERO);
        patience.heard(at(70));
        assert_eq!(patience.left(at(70)), ms(180), "three times 60 ms");
        for scan in 1..=USUAL as u64 {
            patience.heard(at(70 + 10 * scan));
        }
        assert_eq!(patience.left(at(120)), ms(40), "that is long ago");
    }
}
