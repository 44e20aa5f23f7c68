//! Conversion between pixel values and the bytes of a row, in every pixel format.
//!
//! Layouts: Linux kernel documentation, "Luma-only formats" (V4L2_PIX_FMT_Y10, Y12, Y16, Y10P and
//! Y12P). Packed rows end with a whole group of pixels, padded with 0, as MIPI CSI-2 requires:
//! `bytesperline` is 5 * ceil(width / 4) for Y10P and 3 * ceil(width / 2) for Y12P.

use super::PixelFormat;

impl PixelFormat {
    /// Appends a row of pixel values to `bytes`. Values above [`Self::max_value`] are clamped. YUYV
    /// gets neutral chroma.
    pub fn pack_row(self, values: &[u16], bytes: &mut Vec<u8>) {
        let clamped = |value: &u16| (*value).min(self.max_value());
        let levels = values.iter().map(clamped);
        match self {
            Self::Grey => bytes.extend(levels.map(|level| level as u8)),
            Self::Yuyv => bytes.extend(levels.flat_map(|level| [level as u8, 128])),
            Self::Y16 | Self::Y10 | Self::Y12 => bytes.extend(levels.flat_map(u16::to_le_bytes)),
            Self::Y10P => pack_groups::<4>(2, values, clamped, bytes),
            Self::Y12P => pack_groups::<2>(4, values, clamped, bytes),
        }
    }

    /// Reads the pixel values of a row. Values whose bytes are missing become 0.
    pub fn unpack_row(self, bytes: &[u8], values: &mut [u16]) {
        let byte = |at: usize| u16::from(bytes.get(at).copied().unwrap_or(0));
        for (i, value) in values.iter_mut().enumerate() {
            *value = match self {
                Self::Grey => byte(i),
                Self::Yuyv => byte(2 * i),
                Self::Y16 | Self::Y10 | Self::Y12 => byte(2 * i) | byte(2 * i + 1) << 8,
                Self::Y10P => {
                    let (first, place) = (i / 4 * 5, i % 4);
                    byte(first + place) << 2 | byte(first + 4) >> (2 * place) & 0b11
                }
                Self::Y12P => {
                    let (first, place) = (i / 2 * 3, i % 2);
                    byte(first + place) << 4 | byte(first + 2) >> (4 * place) & 0xF
                }
            };
        }
    }
}

/// Packs groups of `N` values: first one byte with the high bits of each value, then one byte with
/// the `low` low bits of all values, with the first value's bits lowest.
fn pack_groups<const N: usize>(
    low: u32,
    values: &[u16],
    clamped: impl Fn(&u16) -> u16,
    bytes: &mut Vec<u8>,
) {
    for group in values.chunks(N) {
        let mut high = [0u8; N];
        let mut rest = 0u8;
        for (place, value) in group.iter().map(&clamped).enumerate() {
            high[place] = (value >> low) as u8;
            let bits = (value & ((1 << low) - 1)) as u8;
            rest |= bits << (low as usize * place);
        }
        bytes.extend_from_slice(&high);
        bytes.push(rest);
    }
}

#[cfg(test)]
#[path = "packing_tests.rs"]
mod tests;
