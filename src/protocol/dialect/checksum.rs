//! Checksums of packets.

use serde::Deserialize;

/// Checksum algorithm of a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub(super) enum Checksum {
    /// Sum of the bytes modulo 256.
    Sum8,
    /// Exclusive or of the bytes.
    Xor8,
    /// 16-bit cyclic redundancy check with the polynomial of ITU-T V.41, 0x1021, initial value
    /// 0xFFFF, most significant bit first.
    Crc16Ccitt,
    /// CRC-32 of IEEE 802.3.
    Crc32,
}

impl Checksum {
    /// Returns its size in bytes.
    pub(super) fn len(self) -> usize {
        match self {
            Self::Sum8 | Self::Xor8 => 1,
            Self::Crc16Ccitt => 2,
            Self::Crc32 => 4,
        }
    }

    pub(super) fn of(self, bytes: &[u8]) -> u32 {
        match self {
            Self::Sum8 => bytes.iter().fold(0u8, |sum, b| sum.wrapping_add(*b)).into(),
            Self::Xor8 => bytes.iter().fold(0u8, |sum, b| sum ^ b).into(),
            Self::Crc16Ccitt => bytes
                .iter()
                .fold(0xFFFFu16, |crc, b| {
                    (0..8).fold(crc ^ u16::from(*b) << 8, |crc, _| {
                        let carry = if crc & 0x8000 == 0 { 0 } else { 0x1021 };
                        crc << 1 ^ carry
                    })
                })
                .into(),
            Self::Crc32 => crc32fast::hash(bytes),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares with the check values that catalogues of checksums give for the digits 1 to 9.
    #[test]
    fn matches_published_check_values() {
        for (kind, value) in [
            (Checksum::Sum8, 0xDD),
            (Checksum::Xor8, 0x31),
            (Checksum::Crc16Ccitt, 0x29B1),
            (Checksum::Crc32, 0xCBF4_3926),
        ] {
            assert_eq!(kind.of(b"123456789"), value, "{kind:?}");
        }
    }
}
