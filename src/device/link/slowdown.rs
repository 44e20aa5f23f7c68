//! Detects that a device whose clock is in real time renders its frames more slowly than it exposes
//! them.
//!
//! Each frame has a ratio: its render time divided by the interval of its exposure. The slowdown is
//! the lower quartile of the ratios of the latest frames, so three of four frames took at least this
//! multiple of their interval. It is computed from at least [`MIN_FRAMES`] frames that together took
//! at least [`MIN_RENDERING`]. A single slow frame, such as the first frame of a scene or one during
//! a pause of the machine, therefore has no effect.

use std::collections::VecDeque;
use std::time::Duration;

/// Minimum number of frames from which a slowdown is computed.
const MIN_FRAMES: usize = 12;
/// Minimum total render time of these frames, so that a machine that is busy for a moment does not
/// count as slow.
const MIN_RENDERING: Duration = Duration::from_secs(1);
/// Number of frames that suffices even if they took less than [`MIN_RENDERING`]; it bounds the
/// memory.
const MAX_FRAMES: usize = 1000;
/// Minimum slowdown that is reported. Below it, a sequence is late by only a fraction of its own
/// length.
const MIN_SLOWDOWN: f64 = 1.5;
/// Factor by which a reported slowdown must change to be reported again.
const CHANGE: f64 = 1.5;
/// When the machine has become fast again, slowdowns smaller than this are reported as this value.
const MIN_REPORTED: f64 = 0.1;

/// Measures the slowdown of a device with a clock in real time.
#[derive(Debug, Default)]
pub(super) struct Slowdown {
    /// Pattern index and start of the last exposure of a sequence.
    previous: Option<(u32, u64)>,
    /// Render times and ratios of the latest frames.
    frames: VecDeque<(Duration, f64)>,
    /// Sum of the render times in `frames`.
    rendering: Duration,
    /// The slowdown that was reported last.
    reported: Option<f64>,
}

impl Slowdown {
    /// Returns the interval of an exposure that starts at `start_ns`: `free_ns` if the camera runs
    /// free, else the time since the preceding exposure of the sequence; `None` if there is no
    /// preceding exposure.
    pub(super) fn interval(
        &mut self,
        pattern_index: Option<u32>,
        start_ns: u64,
        free_ns: u64,
    ) -> Option<Duration> {
        let previous = self.previous.take();
        let Some(index) = pattern_index else {
            return Some(Duration::from_nanos(free_ns));
        };
        self.previous = Some((index, start_ns));
        let (before, before_ns) = previous?;
        (index.checked_sub(1) == Some(before))
            .then(|| Duration::from_nanos(start_ns.saturating_sub(before_ns)))
    }

    /// Adds a rendered frame. Returns the slowdown when it is to be reported: when it is first
    /// detected, and when it has changed.
    pub(super) fn rendered(&mut self, took: Duration, interval: Duration) -> Option<f64> {
        if interval.is_zero() {
            return None;
        }
        let ratio = took.as_secs_f64() / interval.as_secs_f64();
        self.frames.push_back((took, ratio));
        self.rendering += took;
        let enough = |frames: usize, rendering: Duration| {
            frames >= MAX_FRAMES || frames >= MIN_FRAMES && rendering >= MIN_RENDERING
        };
        while let Some(&(oldest, _)) = self.frames.front()
            && enough(self.frames.len() - 1, self.rendering - oldest)
        {
            self.frames.pop_front();
            self.rendering -= oldest;
        }
        if !enough(self.frames.len(), self.rendering) {
            return None;
        }
        let slowdown = two_digits(self.lower_quartile()).max(MIN_REPORTED);
        let report = match self.reported {
            None => slowdown >= MIN_SLOWDOWN,
            Some(reported) => slowdown > reported * CHANGE || slowdown * CHANGE < reported,
        };
        if !report {
            return None;
        }
        // The next report needs new frames, so that it cannot follow immediately.
        self.frames.clear();
        self.rendering = Duration::ZERO;
        self.reported = Some(slowdown);
        self.reported
    }

    fn lower_quartile(&self) -> f64 {
        let mut ratios: Vec<f64> = self.frames.iter().map(|(_, ratio)| *ratio).collect();
        let rank = ratios.len() / 4;
        *ratios.select_nth_unstable_by(rank, f64::total_cmp).1
    }
}

/// Rounds to two significant digits.
pub(super) fn two_digits(value: f64) -> f64 {
    format!("{value:.1e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    const INTERVAL: Duration = Duration::from_millis(20);

    /// Adds frames with these render times in milliseconds, and returns the reported slowdowns.
    fn reports(slowdown: &mut Slowdown, ms: impl IntoIterator<Item = u64>) -> Vec<f64> {
        let add = |ms| slowdown.rendered(Duration::from_millis(ms), INTERVAL);
        ms.into_iter().filter_map(add).collect()
    }

    #[test]
    fn interval_is_the_time_between_exposures_of_a_sequence() {
        let mut slowdown = Slowdown::default();
        let ms = |ms| Some(Duration::from_millis(ms));
        let mut interval =
            |index, start_ms: u64| slowdown.interval(index, start_ms * 1_000_000, 33_000_000);
        assert_eq!(interval(None, 0), ms(33));
        assert_eq!(
            interval(None, 990),
            ms(33),
            "skipped frames do not lengthen the interval"
        );
        assert_eq!(interval(Some(0), 1000), None);
        assert_eq!(interval(Some(1), 1016), ms(16));
        assert_eq!(interval(Some(2), 1032), ms(16));
        assert_eq!(
            interval(Some(0), 9000),
            None,
            "a pause before a sequence does not count"
        );
        assert_eq!(interval(Some(2), 9016), None, "an exposure is missing");
    }

    #[test]
    fn slow_frames_are_reported_once() {
        let mut slowdown = Slowdown::default();
        assert_eq!(reports(&mut slowdown, [76; 100]), [3.8]);
        // Eleven frames are too few, however long they take.
        let mut slowdown = Slowdown::default();
        assert_eq!(reports(&mut slowdown, [8040; 11]), [0.0; 0]);
        assert_eq!(reports(&mut slowdown, [8040; 40]), [400.0]);
    }

    #[test]
    fn hiccups_are_not_reported() {
        let mut slowdown = Slowdown::default();
        // A machine that pauses now and then, and a busy machine that is slow for half of the
        // frames, are not reported.
        let hiccups = (0..200).map(|i| if i % 10 == 0 { 2000 } else { 8 });
        assert_eq!(reports(&mut slowdown, hiccups), [0.0; 0]);
        let busy = (0..200).map(|i| if i % 2 == 0 { 90 } else { 15 });
        assert_eq!(reports(&mut slowdown, busy), [0.0; 0]);
        // A whole sequence during a load of less than a second is not reported.
        let mut slowdown = Slowdown::default();
        assert_eq!(reports(&mut slowdown, [60; 12]), [0.0; 0]);
        assert_eq!(reports(&mut slowdown, [8; 500]), [0.0; 0]);
        // Frames that take as long as their interval are not reported.
        assert_eq!(reports(&mut slowdown, [25; 200]), [0.0; 0]);
    }

    #[test]
    fn changes_of_more_than_half_are_reported() {
        let mut slowdown = Slowdown::default();
        assert_eq!(reports(&mut slowdown, [76; 50]), [3.8]);
        assert_eq!(reports(&mut slowdown, [100; 50]), [0.0; 0]);
        assert_eq!(reports(&mut slowdown, [200; 50]).last(), Some(&10.0));
        // The machine has become fast enough.
        assert_eq!(reports(&mut slowdown, [8; 500]).last(), Some(&0.4));
        assert_eq!(reports(&mut slowdown, [0; 5000]), [0.1]);
        assert!(slowdown.frames.len() <= MAX_FRAMES);
    }
}
