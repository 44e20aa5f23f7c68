//! Effects of faults on the bytes of a frame. The frame's identity is unchanged: a link carries the
//! identity beside the pixels and does not know about the fault.

use super::chance::Draws;
use phasmid_protocol::Frame;

/// Replaces all rows from `row` on by the corresponding rows of the previous frame, or by black if
/// the previous frame has another shape.
pub(super) fn torn(frame: &mut Frame, before: Option<&Frame>, row: Option<u32>) {
    let at = offset(frame, row);
    let same = before.filter(|before| {
        let shape = |f: &Frame| (f.width, f.height, f.format, f.data.len());
        shape(before) == shape(frame)
    });
    match same {
        Some(before) => frame.data[at..].copy_from_slice(&before.data[at..]),
        None => frame.data[at..].fill(0),
    }
}

/// Removes rows, moves the rows below them up, and fills the bottom with black.
pub(super) fn rows_missing(frame: &mut Frame, row: Option<u32>, rows: u32) {
    let at = offset(frame, row);
    let lost = (row_bytes(frame) * rows as usize).min(frame.data.len() - at);
    frame.data.copy_within(at + lost.., at);
    let end = frame.data.len() - lost;
    frame.data[end..].fill(0);
}

/// Inverts bits at random positions.
pub(super) fn bits_flipped(bytes: &mut [u8], count: u32, draws: &mut Draws) {
    for _ in 0..count {
        let at = draws.below(bytes.len());
        let bit = 1 << draws.below(8);
        if let Some(byte) = bytes.get_mut(at) {
            *byte ^= bit;
        }
    }
}

fn row_bytes(frame: &Frame) -> usize {
    frame.format.row_bytes(frame.width)
}

/// Returns the byte offset of a row, or of the middle row if `row` is `None`. For a row beyond the
/// last one, returns the end of the frame.
fn offset(frame: &Frame, row: Option<u32>) -> usize {
    let row = row.unwrap_or(frame.height / 2) as usize;
    row_bytes(frame).saturating_mul(row).min(frame.data.len())
}

#[cfg(test)]
mod tests {
    use super::super::chance::Chance;
    use super::*;
    use phasmid_protocol::PixelFormat;

    fn frame(level: u8) -> Frame {
        Frame {
            id: 3,
            pattern_index: Some(1),
            width: 4,
            height: 6,
            format: PixelFormat::Y16,
            exposure_start_ns: 0,
            exposure_end_ns: 1,
            data: (0..48).map(|i| level + i / 8).collect(),
        }
    }

    /// Returns the first byte of each row.
    fn rows(frame: &Frame) -> Vec<u8> {
        frame.data.chunks_exact(8).map(|row| row[0]).collect()
    }

    #[test]
    fn rows_are_torn_and_missing() {
        let mut torn_frame = frame(10);
        torn(&mut torn_frame, Some(&frame(50)), None);
        assert_eq!(rows(&torn_frame), [10, 11, 12, 53, 54, 55]);
        let mut alone = frame(10);
        torn(&mut alone, None, Some(5));
        assert_eq!(rows(&alone), [10, 11, 12, 13, 14, 0]);
        let mut cut = frame(10);
        rows_missing(&mut cut, Some(1), 2);
        assert_eq!(rows(&cut), [10, 13, 14, 15, 0, 0]);
        let mut beheaded = frame(10);
        rows_missing(&mut beheaded, Some(0), 2);
        assert_eq!(rows(&beheaded), [12, 13, 14, 15, 0, 0]);
        for (row, lost) in [(Some(4), 9), (Some(9), 1), (Some(u32::MAX), u32::MAX)] {
            let mut far = frame(10);
            rows_missing(&mut far, row, lost);
            torn(&mut far, None, row);
            assert_eq!((far.data.len(), far.data[0]), (48, 10));
        }
    }

    #[test]
    fn as_many_bits_are_flipped_as_are_asked_for() {
        let mut bytes = vec![0u8; 1 << 16];
        bits_flipped(&mut bytes, 20, &mut Chance::new(1, "").draws(1, 1));
        // The probability that two of twenty draws hit the same one of half a million bits is 4e-4,
        // and the seed is fixed.
        assert_eq!(bytes.iter().map(|b| b.count_ones()).sum::<u32>(), 20);
        bits_flipped(&mut [], 20, &mut Chance::new(1, "").draws(1, 1));
    }
}
