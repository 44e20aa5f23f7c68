//! The deadline for the next scan, after which the beam is held.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// A timeout that never expires in practice, used while no deadline applies.
pub(super) const FOREVER: Duration = Duration::from_secs(365 * 24 * 3600);

/// Number of recent intervals between scans that are remembered.
const USUAL: usize = 5;
/// The deadline for a scan is this multiple of the longest of the recent intervals.
const TIMES: u32 = 3;

/// The deadline for the next scan, on the host's clock, because the device's clock is unknown while
/// no frames arrive. An emulated device may need more real time for a scan than passes on its own
/// clock, so the deadline also depends on the recent intervals.
pub(super) struct ScanDeadline {
    least: Duration,
    last: Option<Instant>,
    usual: VecDeque<Duration>,
}

impl ScanDeadline {
    /// `least` is the minimum deadline: the age at which readings are stale and the beam is held.
    pub(super) fn new(least: Duration) -> Self {
        Self {
            least,
            last: None,
            usual: VecDeque::new(),
        }
    }

    /// Notes that a scan has arrived at `now`.
    pub(super) fn heard(&mut self, now: Instant) {
        if let Some(last) = self.last.replace(now) {
            if self.usual.len() == USUAL {
                self.usual.pop_front();
            }
            self.usual.push_back(now - last);
        }
    }

    /// Returns the deadline as a moment of the host's clock.
    pub(super) fn due(&self, now: Instant) -> Instant {
        now + self.left(now)
    }

    /// Returns the time left until the deadline, or [`FOREVER`] before two scans have arrived.
    fn left(&self, now: Instant) -> Duration {
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
    fn deadline_adapts_to_the_interval_of_scans() {
        let begin = Instant::now();
        let at = |ms: u64| begin + Duration::from_millis(ms);
        let ms = Duration::from_millis;
        let mut scan_deadline = ScanDeadline::new(ms(40));
        assert_eq!(scan_deadline.left(at(0)), FOREVER);
        scan_deadline.heard(at(0));
        assert_eq!(scan_deadline.left(at(5)), FOREVER, "no interval yet");
        scan_deadline.heard(at(10));
        assert_eq!(scan_deadline.left(at(20)), ms(30));
        assert_eq!(scan_deadline.left(at(70)), Duration::ZERO);
        scan_deadline.heard(at(70));
        assert_eq!(scan_deadline.left(at(70)), ms(180), "three times 60 ms");
        for scan in 1..=USUAL as u64 {
            scan_deadline.heard(at(70 + 10 * scan));
        }
        assert_eq!(scan_deadline.left(at(120)), ms(40), "that is long ago");
    }
}
