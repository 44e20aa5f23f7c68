//! Device time: integer nanoseconds since power-on. The device never reads a wall clock; its driver
//! passes the time in: a [`Bench`](super::Bench) from this clock, a server from its timeline.

/// A clock that stands still until something waits for a time and then jumps there: a sequence
/// takes no longer than its rendering, and every run is identical to the nanosecond.
#[derive(Debug, Clone, Copy, Default)]
pub struct VirtualClock {
    now_ns: u64,
}

impl VirtualClock {
    /// Returns the device time in nanoseconds; it never decreases.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Jumps to `until_ns` if that is in the future.
    pub fn wait(&mut self, until_ns: u64) {
        self.now_ns = self.now_ns.max(until_ns);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waiting_advances_the_clock_and_never_sets_it_back() {
        let mut clock = VirtualClock::default();
        assert_eq!(clock.now_ns(), 0);
        clock.wait(7_000_000);
        clock.wait(1);
        assert_eq!(clock.now_ns(), 7_000_000);
    }
}
