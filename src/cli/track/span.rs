//! The exposure times of a scan's frames, by the device's clock.

use phasmid_decode::FrameInfo;

/// The time from the start of the first exposure to the end of the last, in nanoseconds; both are 0 if the
/// links carry no times.
#[derive(Default)]
pub(super) struct Span {
    begin_ns: Option<u64>,
    pub(super) end_ns: u64,
}

impl Span {
    /// Extends the span by the frames of a pod.
    pub(super) fn take(&mut self, frames: &[FrameInfo]) {
        let [Some(first), Some(last)] = [frames.first(), frames.last()] else {
            return;
        };
        let begin_ns = first.exposure_start_ns;
        self.begin_ns = Some(self.begin_ns.map_or(begin_ns, |known| known.min(begin_ns)));
        self.end_ns = self.end_ns.max(last.exposure_end_ns);
    }

    /// Returns the time from the middle of the scan to its end in milliseconds; `None` if the links carry
    /// no times. A patient in uniform motion is measured where they were in the middle of the scan.
    pub(super) fn middle_to_end_ms(&self) -> Option<f64> {
        let length_ns = self.end_ns.checked_sub(self.begin_ns?)?;
        (length_ns > 0).then_some(0.5e-6 * length_ns as f64)
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
        assert_eq!(span.middle_to_end_ms(), None);
        span.take(&[frame(10_000_000), frame(18_000_000)]);
        assert_eq!(span.middle_to_end_ms(), Some(5.0));
        span.take(&[frame(30_000_000), frame(48_000_000)]);
        assert_eq!(
            (span.end_ns, span.middle_to_end_ms()),
            (50_000_000, Some(20.0))
        );
    }
}
