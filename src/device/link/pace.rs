//! Delivers frames no closer together than they were exposed.
//!
//! Frames that were rendered late arrive in a burst, and a V4L2 reader that finds more than a few
//! new frames skips to the newest (v4l2loopback 0.12: if there are more than two, regardless of the
//! number of buffers). The intervals between the departures of a sequence's frames are therefore at
//! least as long as the intervals between their exposures. Frames of a free-running camera are not
//! delayed, since skipping one does no harm.

use phasmid_protocol::Frame;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::{Instant, sleep_until};

/// Maximum delay of a frame; exposures further apart than this do not form a burst.
const MAX_WAIT: Duration = Duration::from_secs(1);

/// Holds a frame back until it is due.
#[derive(Default)]
pub(super) struct Pace {
    held: Option<(Arc<Frame>, Instant)>,
    /// Time at which the last frame left, and the start of its exposure in nanoseconds of device
    /// time.
    last: Option<(Instant, u64)>,
}

impl Pace {
    /// Returns whether a frame is held; no other frame may be added then.
    pub(super) fn holds(&self) -> bool {
        self.held.is_some()
    }

    /// Adds the next frame.
    pub(super) fn take(&mut self, frame: Arc<Frame>, now: Instant) {
        let due = match self.last {
            Some((went, start_ns)) if frame.pattern_index.is_some() => {
                let apart = frame.exposure_start_ns.saturating_sub(start_ns);
                went + Duration::from_nanos(apart).min(MAX_WAIT)
            }
            _ => now,
        };
        self.held = Some((frame, due.max(now)));
    }

    /// Returns the held frame once it is due; waits forever if there is none. Safe to cancel.
    pub(super) async fn due(&mut self) -> Arc<Frame> {
        let Some((_, due)) = &self.held else {
            return std::future::pending().await;
        };
        let due = *due;
        if due > Instant::now() {
            sleep_until(due).await;
        }
        match self.held.take() {
            Some((frame, _)) => {
                self.last = Some((Instant::now(), frame.exposure_start_ns));
                frame
            }
            None => std::future::pending().await,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_protocol::PixelFormat;

    fn frame(start_ms: u64, pattern_index: Option<u32>) -> Arc<Frame> {
        Arc::new(Frame {
            id: start_ms,
            pattern_index,
            width: 0,
            height: 0,
            format: PixelFormat::Grey,
            exposure_start_ns: start_ms * 1_000_000,
            exposure_end_ns: start_ms * 1_000_000 + 1,
            data: Vec::new(),
        })
    }

    /// Returns when each frame leaves, in milliseconds, if all arrive at once.
    fn burst(frames: &[Arc<Frame>]) -> Vec<u128> {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_time()
            .build()
            .unwrap();
        runtime.block_on(async {
            let start = Instant::now();
            let mut pace = Pace::default();
            let mut times = Vec::new();
            for frame in frames {
                pace.take(frame.clone(), Instant::now());
                assert!(pace.holds());
                // Cancelled and awaited again, as in an event loop.
                let short = tokio::time::timeout(Duration::from_millis(1), pace.due()).await;
                let out = match short {
                    Ok(out) => out,
                    Err(_) => pace.due().await,
                };
                assert_eq!(&out, frame);
                times.push(start.elapsed().as_millis());
            }
            times
        })
    }

    #[test]
    fn frames_of_a_burst_are_spaced_as_exposed() {
        let times = burst(&[
            frame(0, Some(0)),
            frame(20, Some(1)),
            frame(50, Some(2)),
            frame(60, None),
        ]);
        assert!(times[0] < 20, "{times:?}");
        assert!(times[1] >= 20 && times[2] >= times[1] + 29, "{times:?}");
        assert!(times[3] < times[2] + 10, "{times:?}");
    }

    #[test]
    fn exposures_far_apart_do_not_wait_for_long() {
        let times = burst(&[frame(0, Some(0)), frame(3_600_000, Some(1))]);
        assert!((999..1500).contains(&times[1]), "{times:?}");
    }
}
