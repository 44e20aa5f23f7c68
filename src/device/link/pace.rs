//! Keeps frames apart as far as their exposures were.
//!
//! Frames that were rendered late come in a burst, and a V4L2 reader that finds more than a few new
//! ones skips to the newest (v4l2loopback 0.12: more than two, whatever the number of buffers). So
//! the frames of a sequence go out no closer to each other than they were exposed. A free-running
//! camera's frames do not wait: one more or less is nobody's loss.

use phasmid_protocol::Frame;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::{Instant, sleep_until};

/// Longest that a frame waits; exposures that are further apart are no burst.
const MAX_WAIT: Duration = Duration::from_secs(1);

/// Holds one frame until its time.
#[derive(Default)]
pub(super) struct Pace {
    held: Option<(Arc<Frame>, Instant)>,
    /// When the last frame went out, and when its exposure had started, in device time.
    last: Option<(Instant, u64)>,
}

impl Pace {
    /// Whether a frame waits; then no other may come.
    pub(super) fn holds(&self) -> bool {
        self.held.is_some()
    }

    /// Takes the next frame.
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

    /// The frame that is held, once it may go; forever without one. Nothing is lost when this is
    /// dropped before.
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

    /// When each frame goes out in milliseconds, all having come at once.
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
                // Given up and asked again, as an event loop does.
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
    fn a_burst_is_spread_as_it_was_exposed() {
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
