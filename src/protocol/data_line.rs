//! Embedded data line: a row above the image that identifies the frame, like the embedded data rows
//! of CMOS sensors, for links that cannot carry metadata next to the pixels.
//!
//! The line holds 32 bytes, little-endian, one pixel per bit, most significant first. A dark pixel
//! is 0 and a bright one 1, so luma conversion, limited range or a slight contrast change corrupts
//! no bit. The rest of the row is dark.
//!
//! | offset | bytes | field |
//! | --- | --- | --- |
//! | 0 | 2 | magic, 0xA5 0x5D |
//! | 2 | 1 | version, 1 |
//! | 3 | 1 | flags: bit 0 if there is a pattern index; all others 0 |
//! | 4 | 8 | id, never repeated in a device's life |
//! | 12 | 4 | pattern index in the selected sequence; 0 if there is none |
//! | 16 | 8 | start of the exposure, nanoseconds of device time |
//! | 24 | 4 | length of the exposure in nanoseconds, to the end of the last row |
//! | 28 | 4 | CRC-32 (IEEE 802.3) of the 28 bytes before |

use super::Frame;

/// Width of the line in pixels, and minimum image width.
pub const WIDTH_PX: u32 = 8 * LEN as u32;
/// Maximum exposure that the line can represent, in nanoseconds.
pub const MAX_EXPOSURE_NS: u64 = u32::MAX as u64;

const LEN: usize = 32;
const MAGIC: [u8; 2] = [0xA5, 0x5D];
const VERSION: u8 = 1;
const HAS_PATTERN: u8 = 1;

/// Result of looking for a data line above an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Found {
    /// No data line: the first row belongs to the image.
    Nothing,
    /// A line with a wrong checksum or an unknown version.
    Damaged,
    /// A valid line.
    Line,
}

/// Adds the line as an extra row above an image. `full_scale_dn` is the maximum pixel value.
///
/// Images narrower than [`WIDTH_PX`] are unchanged; exposures longer than [`MAX_EXPOSURE_NS`] are
/// stored as that maximum.
#[must_use]
pub fn prepend(frame: Frame, full_scale_dn: u16) -> Frame {
    if frame.width < WIDTH_PX {
        return frame;
    }
    let margin = full_scale_dn / 16;
    let (dark, bright) = (margin, full_scale_dn - margin);
    let bits = encode(&frame);
    let rest = (WIDTH_PX..frame.width).map(|_| false);
    let levels: Vec<u16> = bits
        .into_iter()
        .chain(rest)
        .map(|bit| if bit { bright } else { dark })
        .collect();
    let row = frame.format.row_bytes(frame.width);
    let mut data = Vec::with_capacity(frame.data.len() + row);
    frame.format.pack_row(&levels, &mut data);
    data.extend_from_slice(&frame.data);
    Frame {
        height: frame.height + 1,
        data,
        ..frame
    }
}

/// Removes the data line from an image and copies the identity and times that it holds into the
/// frame. A frame without a valid line is unchanged.
#[must_use]
pub fn strip(mut frame: Frame) -> (Frame, Found) {
    let row = frame.format.row_bytes(frame.width);
    if frame.width < WIDTH_PX || frame.height < 2 || frame.data.len() <= row {
        return (frame, Found::Nothing);
    }
    let Some(bytes) = read_bits(&frame) else {
        return (frame, Found::Nothing);
    };
    let u32_at = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("4 bytes"));
    let u64_at = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().expect("8 bytes"));
    if bytes[..2] != MAGIC {
        return (frame, Found::Nothing);
    }
    if crc32fast::hash(&bytes[..LEN - 4]) != u32_at(LEN - 4) || bytes[2] != VERSION {
        return (frame, Found::Damaged);
    }
    frame.id = u64_at(4);
    frame.pattern_index = (bytes[3] & HAS_PATTERN != 0).then(|| u32_at(12));
    frame.exposure_start_ns = u64_at(16);
    frame.exposure_end_ns = u64_at(16).saturating_add(u32_at(24).into());
    frame.height -= 1;
    frame.data.drain(..row);
    (frame, Found::Line)
}

/// Returns the bits of a frame's data line in pixel order.
fn encode(frame: &Frame) -> [bool; 8 * LEN] {
    let mut bytes = [0u8; LEN];
    let exposure_ns = frame
        .exposure_end_ns
        .saturating_sub(frame.exposure_start_ns);
    bytes[..2].copy_from_slice(&MAGIC);
    bytes[2] = VERSION;
    bytes[3] = if frame.pattern_index.is_some() {
        HAS_PATTERN
    } else {
        0
    };
    bytes[4..12].copy_from_slice(&frame.id.to_le_bytes());
    bytes[12..16].copy_from_slice(&frame.pattern_index.unwrap_or(0).to_le_bytes());
    bytes[16..24].copy_from_slice(&frame.exposure_start_ns.to_le_bytes());
    let told_ns = exposure_ns.min(MAX_EXPOSURE_NS) as u32;
    bytes[24..28].copy_from_slice(&told_ns.to_le_bytes());
    let crc = crc32fast::hash(&bytes[..LEN - 4]);
    bytes[28..].copy_from_slice(&crc.to_le_bytes());
    std::array::from_fn(|i| bytes[i / 8] >> (7 - i % 8) & 1 == 1)
}

/// Returns the bits of the first row. The threshold is midway between the row's darkest and
/// brightest pixel, because the bit depth of a Y16 sensor is unknown here. Returns `None` if these
/// two levels are too close.
fn read_bits(frame: &Frame) -> Option<[u8; LEN]> {
    let mut levels = [0u16; 8 * LEN];
    frame.format.unpack_row(&frame.data, &mut levels);
    let darkest = levels.iter().min().copied()?;
    let brightest = levels.iter().max().copied()?;
    if brightest / 2 <= darkest {
        return None;
    }
    let threshold = darkest + (brightest - darkest) / 2;
    let mut bytes = [0u8; LEN];
    for (i, level) in levels.iter().enumerate() {
        bytes[i / 8] |= u8::from(*level > threshold) << (7 - i % 8);
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PixelFormat;
    use proptest::prelude::*;

    fn frame(format: PixelFormat, width: u32, noise: u64) -> Frame {
        let height = 3;
        let mut state = noise | 1;
        let bytes = format.frame_bytes(width, height);
        let data = (0..bytes)
            .map(|_| {
                state = state
                    .wrapping_mul(6364136223846793005)
                    .wrapping_add(1442695040888963407);
                (state >> 56) as u8
            })
            .collect();
        Frame {
            id: noise,
            pattern_index: (!noise.is_multiple_of(3)).then_some(noise as u32),
            width,
            height,
            format,
            exposure_start_ns: noise / 3,
            exposure_end_ns: noise / 3 + noise % (MAX_EXPOSURE_NS + 1),
            data,
        }
    }

    /// Converts a level as a viewer does that treats YUYV as limited range.
    fn stretched(level: u8) -> u8 {
        ((f64::from(level) - 16.0) * 255.0 / 219.0).clamp(0.0, 255.0) as u8
    }

    proptest! {
        #[test]
        fn stripped_data_line_restores_the_frame(
            noise: u64, width in WIDTH_PX..700, full in 200u16.., kind in 0..5
        ) {
            let (format, full) = match kind {
                0 => (PixelFormat::Grey, 255),
                1 => (PixelFormat::Y16, full),
                2 => (PixelFormat::Y10P, 0x3FF),
                3 => (PixelFormat::Y12P, 0xFFF),
                _ => (PixelFormat::Yuyv, 255),
            };
            let bare = frame(format, width, noise);
            let lined = prepend(bare.clone(), full);
            prop_assert_eq!(lined.height, 4);
            prop_assert_eq!(lined.data.len(), bare.data.len() / 3 * 4);
            let anonymous = Frame { id: 0, pattern_index: None, exposure_start_ns: 0, exposure_end_ns: 0, ..lined };
            prop_assert_eq!(strip(anonymous), (bare, Found::Line));
        }

        #[test]
        fn survives_yuyv_and_a_change_of_range(noise: u64) {
            let bare = frame(PixelFormat::Grey, 300, noise);
            let mut lined = prepend(bare.clone(), 255);
            lined = lined.into_yuyv().into_luma();
            for level in &mut lined.data[..300] {
                *level = stretched(*level);
            }
            prop_assert_eq!(strip(lined), (bare, Found::Line));
        }

        #[test]
        fn flipped_bit_is_damage_and_noise_is_no_data_line(noise: u64, pixel in 16usize..256) {
            let lined = prepend(frame(PixelFormat::Grey, 256, noise), 255);
            let mut bad = lined.clone();
            bad.data[pixel] = if bad.data[pixel] > 128 { 15 } else { 240 };
            prop_assert_eq!(strip(bad.clone()), (bad, Found::Damaged));
            let plain = frame(PixelFormat::Grey, 256, noise);
            let found = strip(plain.clone());
            prop_assert_eq!(&found.0, &plain);
            prop_assert_ne!(found.1, Found::Line);
        }
    }

    #[test]
    fn flat_and_narrow_images_have_no_data_line() {
        for level in [0u8, 128, 255] {
            let mut flat = frame(PixelFormat::Grey, 256, 1);
            flat.data.fill(level);
            assert_eq!(strip(flat.clone()), (flat, Found::Nothing));
        }
        let narrow = frame(PixelFormat::Grey, WIDTH_PX - 1, 1);
        assert_eq!(prepend(narrow.clone(), 255), narrow);
        assert_eq!(strip(narrow.clone()), (narrow, Found::Nothing));
    }
}
