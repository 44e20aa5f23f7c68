//! Packing of rows is compared with byte vectors written out from the kernel's layout tables.

use super::*;
use crate::Frame;
use proptest::prelude::*;

fn packed(format: PixelFormat, values: &[u16]) -> Vec<u8> {
    let mut bytes = Vec::new();
    format.pack_row(values, &mut bytes);
    bytes
}

fn unpacked(format: PixelFormat, bytes: &[u8], width: usize) -> Vec<u16> {
    let mut values = vec![0xAAAA; width];
    format.unpack_row(bytes, &mut values);
    values
}

#[test]
fn rows_have_the_layout_of_the_kernel_documentation() {
    use PixelFormat::{Grey, Y10, Y10P, Y12, Y12P, Y16, Yuyv};
    let cases: [(PixelFormat, &[u16], &[u8]); 12] = [
        (Grey, &[1, 255], &[1, 255]),
        (Yuyv, &[1, 255], &[1, 128, 255, 128]),
        (Y16, &[0x1234, 0xFFFF], &[0x34, 0x12, 0xFF, 0xFF]),
        (Y10, &[0x3FF, 0x102], &[0xFF, 0x03, 0x02, 0x01]),
        (Y12, &[0xFFF, 0x102], &[0xFF, 0x0F, 0x02, 0x01]),
        // Bytes Y0[9:2], Y1[9:2], Y2[9:2], Y3[9:2], then one byte of Y3[1:0] Y2[1:0] Y1[1:0]
        // Y0[1:0].
        (
            Y10P,
            &[0x3FF, 0x001, 0x202, 0x100],
            &[0xFF, 0x00, 0x80, 0x40, 0b00_10_01_11],
        ),
        (Y10P, &[0, 0, 0, 3], &[0, 0, 0, 0, 0b11_00_00_00]),
        // Groups that the width does not fill are padded with 0.
        (Y10P, &[0x3FF], &[0xFF, 0, 0, 0, 0b11]),
        (
            Y10P,
            &[4, 8, 12, 16, 0x155],
            &[1, 2, 3, 4, 0, 0x55, 0, 0, 0, 0b01],
        ),
        // Bytes Y0[11:4], Y1[11:4], then one byte of Y1[3:0] Y0[3:0].
        (Y12P, &[0xABC, 0x123], &[0xAB, 0x12, 0x3C]),
        (Y12P, &[0xABC], &[0xAB, 0, 0x0C]),
        (
            Y12P,
            &[0x001, 0xFFE, 0x7F0],
            &[0x00, 0xFF, 0xE1, 0x7F, 0, 0],
        ),
    ];
    for (format, values, bytes) in cases {
        assert_eq!(packed(format, values), bytes, "{format:?} {values:x?}");
        assert_eq!(unpacked(format, bytes, values.len()), values, "{format:?}");
        assert_eq!(format.row_bytes(values.len() as u32), bytes.len());
    }
}

#[test]
fn values_above_the_maximum_are_clamped() {
    for format in PixelFormat::ALL {
        let max = format.max_value();
        let bytes = packed(format, &[u16::MAX; 4]);
        assert_eq!(unpacked(format, &bytes, 4), [max; 4], "{format:?}");
    }
}

#[test]
fn missing_bytes_are_read_as_zero() {
    for format in PixelFormat::ALL {
        assert_eq!(unpacked(format, &[], 5), [0; 5], "{format:?}");
    }
    assert_eq!(
        unpacked(PixelFormat::Y12P, &[0xAB, 0x12], 2),
        [0xAB0, 0x120]
    );
}

#[test]
fn codes_and_names_agree() {
    for format in PixelFormat::ALL {
        let code = format.fourcc();
        assert_eq!(PixelFormat::from_fourcc(code), Some(format));
        assert_eq!(String::from_utf8_lossy(&code).trim_end(), format.name());
        let quoted = serde_json::to_string(&format).unwrap();
        assert_eq!(quoted, format!("{:?}", format.name()));
        assert_eq!(format.row_bytes(8) * 8, 64 * format.bits_per_pixel() / 8);
    }
    assert_eq!(PixelFormat::from_fourcc(*b"Y14 "), None);
}

proptest! {
    #[test]
    fn packed_rows_unpack_equal(
        row in proptest::collection::vec(any::<u16>(), 1..=20), kind in 0usize..7
    ) {
        let format = PixelFormat::ALL[kind];
        let row: Vec<u16> = row.iter().map(|value| value & format.max_value()).collect();
        let bytes = packed(format, &row);
        prop_assert_eq!(bytes.len(), format.row_bytes(row.len() as u32));
        prop_assert_eq!(unpacked(format, &bytes, row.len()), row);
    }

    #[test]
    fn frames_of_every_depth_return_to_the_same_y16_frame(
        width in 1u32..=20, height in 1u32..5, seed: u16, kind in 3usize..7
    ) {
        let format = PixelFormat::ALL[kind];
        let values = (0..width * height).map(|i| {
            (i as u16).wrapping_mul(40_503).wrapping_add(seed) & format.max_value()
        });
        let frame = Frame {
            id: 3,
            pattern_index: Some(1),
            width,
            height,
            format: PixelFormat::Y16,
            exposure_start_ns: 1,
            exposure_end_ns: 2,
            data: values.flat_map(u16::to_le_bytes).collect(),
        };
        let sent = frame.clone().into_depth(format);
        prop_assert_eq!(sent.format, format);
        prop_assert_eq!(sent.data.len(), format.frame_bytes(width, height));
        prop_assert_eq!(sent.into_luma(), frame);
    }
}
