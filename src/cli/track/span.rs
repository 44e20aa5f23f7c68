//! When the frames of a scan were exposed, by the device's clock.

use phasmid_protocol::Frame;

/// From the first exposure's begin to the last one's end, in nanoseconds; 0 to 0 where the links carry no
/// times.
#[derive(Default)]
pub(super) struct Span {
    begin_ns: Option<u64>,
    pub(super) end_ns: u64,
}

impl Span {
    /// Takes in the frames of a pod.
    pub(super) fn take(&mut self, frames: &[Frame]) {
        let [Some(first), Some(last)] = [frames.first(), frames.last()] else {
            return;
        };
        let begin_ns = first.exposure_start_ns;
        self.begin_ns = Some(self.begin_ns.map_or(begin_ns, |known| known.min(begin_ns)));
        self.end_ns = self.end_ns.max(last.exposure_end_ns);
    }

    /// From the middle of the scan, which is where a patient is seen who moves evenly, to its end, in
    /// milliseconds; none where the links carry no times.
    pub(super) fn middle_to_end_ms(&self) -> Option<f64> {
        let length_ns = self.end_ns.checked_sub(self.begin_ns?)?;
        (length_ns > 0).then_some(0.5e-6 * length_ns as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_protocol::PixelFormat;

    fn frame(exposure_start_ns: u64) -> Frame {
        Frame {
            id: 0,
            pattern_index: None,
            width: 1,
            height: 1,
            format: PixelFormat::Grey,
            exposure_start_ns,
            exposure_end_ns: exposure_start_ns + 2_000_000,
            data: vec![0],
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
