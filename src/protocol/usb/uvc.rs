//! The video class: UVC 1.1 (USB Device Class Definition for Video Devices, revision 1.1).

use crate::PixelFormat;

/// Class-specific requests (UVC 1.1, table A-8).
pub mod request {
    /// SET_CUR.
    pub const SET_CUR: u8 = 0x01;
    /// GET_CUR.
    pub const GET_CUR: u8 = 0x81;
    /// GET_MIN.
    pub const GET_MIN: u8 = 0x82;
    /// GET_MAX.
    pub const GET_MAX: u8 = 0x83;
    /// GET_RES: the step size.
    pub const GET_RES: u8 = 0x84;
    /// GET_LEN.
    pub const GET_LEN: u8 = 0x85;
    /// GET_INFO. Bit 0: GET is supported, bit 1: SET is supported.
    pub const GET_INFO: u8 = 0x86;
    /// GET_DEF.
    pub const GET_DEF: u8 = 0x87;
}

/// Control selectors (UVC 1.1, A.9).
pub mod selector {
    /// CT_EXPOSURE_TIME_ABSOLUTE_CONTROL: 4 bytes, units of 100 us.
    pub const EXPOSURE_TIME_ABSOLUTE: u8 = 0x04;
    /// PU_GAIN_CONTROL: 2 bytes in a device-specific unit.
    pub const GAIN: u8 = 0x04;
    /// VC_REQUEST_ERROR_CODE_CONTROL: 1 byte.
    pub const REQUEST_ERROR_CODE: u8 = 0x02;
    /// VS_PROBE_CONTROL.
    pub const PROBE: u8 = 0x01;
    /// VS_COMMIT_CONTROL.
    pub const COMMIT: u8 = 0x02;
}

/// Values of the request error code control (UVC 1.1, 4.2.1.2).
pub mod error_code {
    /// No error.
    pub const NONE: u8 = 0;
    /// The device's state does not allow the request.
    pub const WRONG_STATE: u8 = 2;
    /// The value is out of range.
    pub const OUT_OF_RANGE: u8 = 4;
    /// Unknown unit.
    pub const INVALID_UNIT: u8 = 5;
    /// Unknown control.
    pub const INVALID_CONTROL: u8 = 6;
    /// Unknown request.
    pub const INVALID_REQUEST: u8 = 7;
}

/// Unit of the exposure control in nanoseconds.
pub const EXPOSURE_UNIT_NS: u64 = 100_000;
/// Unit of the gain control in decibels, which this device defines.
pub const GAIN_UNIT_DB: f64 = 0.01;
/// Unit of frame intervals in nanoseconds.
pub const INTERVAL_UNIT_NS: u64 = 100;

/// Payload header: its length, and the bits of its second byte (UVC 1.1, table 2-5).
pub mod payload {
    /// Length of a header without time stamp and source clock.
    pub const HEADER_LEN: usize = 2;
    /// Frame id bit, which toggles with each frame.
    pub const FID: u8 = 0x01;
    /// Set in the last payload of a frame.
    pub const EOF: u8 = 0x02;
    /// The frame is damaged.
    pub const ERR: u8 = 0x40;
    /// Set if the header ends with this byte's fields.
    pub const EOH: u8 = 0x80;
}

/// Returns the GUID of an uncompressed format: a four-character code and a suffix common to all
/// formats.
pub fn guid(format: PixelFormat) -> [u8; 16] {
    let code = match format {
        // Drivers know 8-bit grey by this name.
        PixelFormat::Grey => *b"Y800",
        PixelFormat::Yuyv => *b"YUY2",
        format => format.fourcc(),
    };
    let mut guid = *b"----\x00\x00\x10\x00\x80\x00\x00\xAA\x00\x38\x9B\x71";
    guid[..4].copy_from_slice(&code);
    guid
}

/// Returns the format of a GUID; `None` if it is unknown.
pub fn format(guid: &[u8]) -> Option<PixelFormat> {
    PixelFormat::ALL
        .into_iter()
        .find(|format| self::guid(*format) == guid)
}

/// Stream parameters that host and device negotiate (probe and commit; UVC 1.1, table 4-75).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Negotiation {
    /// Bit mask of the fields that the host wants to keep fixed. Bit 0: frame interval.
    pub hint: u16,
    /// `bFormatIndex`, from 1.
    pub format: u8,
    /// `bFrameIndex`, from 1.
    pub frame: u8,
    /// Frame interval in units of 100 ns.
    pub interval: u32,
    /// Maximum frame size in bytes.
    pub max_frame: u32,
    /// Maximum payload size in bytes, including the header.
    pub max_payload: u32,
    /// Device clock frequency in hertz.
    pub clock: u32,
}

impl Negotiation {
    /// Length of the structure in UVC 1.1.
    pub const LEN: usize = 34;
    /// Length of the structure in UVC 1.0, which some hosts send.
    pub const SHORT_LEN: usize = 26;

    /// Encodes the structure.
    pub fn encode(&self) -> [u8; Self::LEN] {
        let mut bytes = [0; Self::LEN];
        bytes[..2].copy_from_slice(&self.hint.to_le_bytes());
        bytes[2] = self.format;
        bytes[3] = self.frame;
        bytes[4..8].copy_from_slice(&self.interval.to_le_bytes());
        bytes[18..22].copy_from_slice(&self.max_frame.to_le_bytes());
        bytes[22..26].copy_from_slice(&self.max_payload.to_le_bytes());
        bytes[26..30].copy_from_slice(&self.clock.to_le_bytes());
        bytes
    }

    /// Decodes the structure in either length; returns `None` for any other length.
    pub fn decode(bytes: &[u8]) -> Option<Self> {
        if bytes.len() != Self::LEN && bytes.len() != Self::SHORT_LEN {
            return None;
        }
        let word = |at: usize| {
            let bytes = bytes.get(at..at + 4)?;
            Some(u32::from_le_bytes(bytes.try_into().ok()?))
        };
        Some(Self {
            hint: u16::from_le_bytes([bytes[0], bytes[1]]),
            format: bytes[2],
            frame: bytes[3],
            interval: word(4)?,
            max_frame: word(18)?,
            max_payload: word(22)?,
            clock: word(26).unwrap_or(0),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encoded_negotiations_and_formats_decode_equal() {
        let negotiation = Negotiation {
            hint: 1,
            format: 2,
            frame: 1,
            interval: 333_333,
            max_frame: 557_620,
            max_payload: 32_768,
            clock: 48_000_000,
        };
        let bytes = negotiation.encode();
        assert_eq!(Negotiation::decode(&bytes), Some(negotiation));
        let short = Negotiation::decode(&bytes[..26]).unwrap();
        assert_eq!(
            short,
            Negotiation {
                clock: 0,
                ..negotiation
            }
        );
        assert_eq!(Negotiation::decode(&bytes[..30]), None);
        // GUID {30303859-0000-0010-8000-00AA00389B71} in the byte order of descriptors.
        let y800 = [
            0x59, 0x38, 0x30, 0x30, 0, 0, 0x10, 0, 0x80, 0, 0, 0xAA, 0, 0x38, 0x9B, 0x71,
        ];
        assert_eq!(guid(PixelFormat::Grey), y800);
        // uvcvideo knows Y10 and Y12 by these GUIDs.
        let suffix = [0, 0, 0x10, 0, 0x80, 0, 0, 0xAA, 0, 0x38, 0x9B, 0x71];
        for (known, code) in [
            (PixelFormat::Y10, b"Y10 "),
            (PixelFormat::Y12, b"Y12 "),
            (PixelFormat::Y10P, b"Y10P"),
            (PixelFormat::Y12P, b"Y12P"),
        ] {
            assert_eq!(guid(known)[..], [&code[..], &suffix].concat());
        }
        for known in PixelFormat::ALL {
            assert_eq!(format(&guid(known)), Some(known));
        }
        assert_eq!(format(&[0; 16]), None);
    }
}
