//! The exposure times of a scan's frames, by the device's clock.

use phasmid_decode::FrameInfo;
use std::time::Duration;

/// The start of the first exposure and the end of the last, in nanoseconds of device time; both are
/// 0 if the links carry no times.
#[derive(Default)]
pub(super) struct Span {
    begin_ns: Option<u64>,
    pub(super) end_ns: u64,
}

impl Span {
    /// Extends the span to include the frames of one more pod.
    pub(super) fn take(&mut self, frames: &[FrameInfo]) {
        let [Some(first), Some(last)] = [frames.first(), frames.last()] else {
            return;
        };
        let begin_ns = first.exposure_start_ns;
        self.begin_ns = Some(self.begin_ns.map_or(begin_ns, |known| known.min(begin_ns)));
        self.end_ns = self.end_ns.max(last.exposure_end_ns);
    }

    /// Returns the end of the span, counted from power-on.
    pub(super) fn end(&self) -> Duration {
        Duration::from_nanos(self.end_ns)
    }

    /// Returns the time from the middle of the scan to its end; `None` if the links carry no times.
    /// If a patient moves uniformly, the measured surface is the patient's surface in the middle of
    /// the scan.
    pub(super) fn middle_to_end(&self) -> Option<Duration> {
        let length_ns = self.end_ns.checked_sub(self.begin_ns?)?;
        (length_ns > 0).then_some(Duration::from_nanos(length_ns / 2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(exposure_start_ns: u64) -> FrameInfo {
        FrameInfo {
            id: 0,
            pattern_index: None,
            exposure_start_ns,
            exposure_end_ns: exposure_start_ns + 2_000_000,
        }
    }

    #[test]
    fn a_scan_lasts_from_its_first_frame_to_its_last() {
        let mut span = Span::default();
        let ms = Duration::from_millis;
        assert_eq!(span.middle_to_end(), None);
        span.take(&[frame(10_000_000), frame(18_000_000)]);
        assert_eq!(span.middle_to_end(), Some(ms(5)));
        span.take(&[frame(30_000_000), frame(48_000_000)]);
        assert_eq!((span.end(), span.middle_to_end()), (ms(50), Some(ms(20))));
    }
}
