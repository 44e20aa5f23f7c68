//! Device time: integer nanoseconds from power-on. The device never looks at a wall clock; whoever
//! drives it says what time it is: a [`Bench`](super::Bench) by this clock, a server by its timeline.

/// Device time stands still until something waits for it, then it jumps there: a sequence takes no
/// longer than its rendering, and a run is the same to the nanosecond every time.
#[derive(Debug, Clone, Copy, Default)]
pub struct VirtualClock {
    now_ns: u64,
}

impl VirtualClock {
    /// Device time now, in nanoseconds; never goes back.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Waits for a time, which takes none.
    pub fn wait(&mut self, until_ns: u64) {
        self.now_ns = self.now_ns.max(until_ns);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_jumps_and_never_goes_back() {
        let mut clock = VirtualClock::default();
        assert_eq!(clock.now_ns(), 0);
        clock.wait(7_000_000);
        clock.wait(1);
        assert_eq!(clock.now_ns(), 7_000_000);
    }
}
