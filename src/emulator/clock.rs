//! Device time: integer nanoseconds from power-on. The device never looks at a wall clock; whoever
//! drives it passes in how long it has been running, and a clock makes device time of that.

use std::time::Duration;

/// Makes device time of the wall time since power-on.
pub trait Clock {
    /// Device time now, in nanoseconds; never goes back.
    fn now_ns(&mut self, wall: Duration) -> u64;

    /// How long to sleep until the device's time `until_ns`. A clock that need not wait is there
    /// afterwards.
    fn wait(&mut self, until_ns: u64, wall: Duration) -> Duration;
}

/// Device time is wall time.
#[derive(Debug, Clone, Copy, Default)]
pub struct PacedClock;

impl Clock for PacedClock {
    fn now_ns(&mut self, wall: Duration) -> u64 {
        nanoseconds(wall)
    }

    fn wait(&mut self, until_ns: u64, wall: Duration) -> Duration {
        Duration::from_nanos(until_ns.saturating_sub(nanoseconds(wall)))
    }
}

/// Device time stands still until something waits for it, then it jumps there: a sequence takes no
/// longer than its rendering, and a run is the same to the nanosecond every time.
#[derive(Debug, Clone, Copy, Default)]
pub struct VirtualClock {
    now_ns: u64,
}

impl Clock for VirtualClock {
    fn now_ns(&mut self, _wall: Duration) -> u64 {
        self.now_ns
    }

    fn wait(&mut self, until_ns: u64, _wall: Duration) -> Duration {
        self.now_ns = self.now_ns.max(until_ns);
        Duration::ZERO
    }
}

fn nanoseconds(wall: Duration) -> u64 {
    u64::try_from(wall.as_nanos()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_waits_and_the_other_jumps() {
        let wall = Duration::from_millis(5);
        let mut paced = PacedClock;
        assert_eq!(paced.now_ns(wall), 5_000_000);
        assert_eq!(paced.wait(7_000_000, wall), Duration::from_millis(2));
        assert_eq!(paced.wait(1, wall), Duration::ZERO);
        let mut jumping = VirtualClock::default();
        assert_eq!(jumping.now_ns(wall), 0);
        assert_eq!(jumping.wait(7_000_000, wall), Duration::ZERO);
        assert_eq!(jumping.wait(1, wall), Duration::ZERO);
        assert_eq!(jumping.now_ns(wall), 7_000_000);
    }
}
