//! A frame on the frame socket: a header of 72 bytes, little-endian, then the pixels. The device
//! sends and the application receives. Only lines of [`crate::admission`] may precede the first
//! frame; after that the socket carries nothing except frames.
//!
//! | offset | bytes | field |
//! | --- | --- | --- |
//! | 0 | 4 | magic `PHFR` |
//! | 4 | 2 | version, 1 |
//! | 6 | 2 | length of the header, 72 |
//! | 8 | 8 | id, never repeated in a device's life |
//! | 16 | 4 | pattern index in the selected sequence; 0xFFFFFFFF for none |
//! | 20 | 4 | width in pixels |
//! | 24 | 4 | height in pixels |
//! | 28 | 4 | pixel format, V4L2's four-character code |
//! | 32 | 8 | start of the exposure, nanoseconds of device time |
//! | 40 | 8 | end of the exposure, nanoseconds of device time |
//! | 48 | 8 | length of the payload: width * height * bytes per pixel |
//! | 56 | 4 | CRC-32 (IEEE 802.3) of the payload |
//! | 60 | 4 | flags: 1 in the replay of a camera that does not identify its frames, else 0 |
//! | 64 | 4 | reserved, 0 |
//! | 68 | 4 | CRC-32 of the 68 bytes before |
//!
//! With flag 1 the id is only a running number, the pattern index is missing, and both times are
//! the driver's timestamp of the frame, which most drivers take from the system's monotonic clock.
//! A device never sends such a frame.
//!
//! A reader validates the header before it allocates the payload, and the payload before it passes
//! the frame on.

use super::{Frame, PixelFormat};
use phasmid_core::error::{Error, Result};
use phasmid_pattern::manifest::MAX_SIDE_PX;

/// Length of the header in bytes.
pub const HEADER_LEN: usize = 72;
/// Maximum payload size in bytes.
pub const MAX_PAYLOAD: u64 = 128 << 20;

const MAGIC: [u8; 4] = *b"PHFR";
const VERSION: u16 = 1;
const NO_PATTERN: u32 = u32::MAX;
const COUNTED: u32 = 1;
/// Offset of the checksum in a header.
const CRC_AT: usize = HEADER_LEN - 4;

/// Encodes the header of a frame.
///
/// Does not panic if the frame's data has the length that its size and format require.
pub fn encode_header(frame: &Frame) -> [u8; HEADER_LEN] {
    let mut header = [0; HEADER_LEN];
    let mut at = 0;
    let mut put = |bytes: &[u8]| {
        header[at..at + bytes.len()].copy_from_slice(bytes);
        at += bytes.len();
    };
    put(&MAGIC);
    put(&VERSION.to_le_bytes());
    put(&(HEADER_LEN as u16).to_le_bytes());
    put(&frame.id.to_le_bytes());
    put(&frame.pattern_index.unwrap_or(NO_PATTERN).to_le_bytes());
    put(&frame.width.to_le_bytes());
    put(&frame.height.to_le_bytes());
    put(&frame.format.fourcc());
    put(&frame.exposure_start_ns.to_le_bytes());
    put(&frame.exposure_end_ns.to_le_bytes());
    put(&(frame.data.len() as u64).to_le_bytes());
    put(&crc32fast::hash(&frame.data).to_le_bytes());
    let crc = crc32fast::hash(&header[..CRC_AT]);
    header[CRC_AT..].copy_from_slice(&crc.to_le_bytes());
    header
}

/// Encodes the header of a frame from a camera that does not identify its frames.
pub fn encode_counted_header(frame: &Frame) -> [u8; HEADER_LEN] {
    let mut header = encode_header(frame);
    header[60..64].copy_from_slice(&COUNTED.to_le_bytes());
    let crc = crc32fast::hash(&header[..CRC_AT]);
    header[CRC_AT..].copy_from_slice(&crc.to_le_bytes());
    header
}

/// A validated header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameHeader {
    id: u64,
    pattern_index: Option<u32>,
    width: u32,
    height: u32,
    format: PixelFormat,
    exposure_ns: (u64, u64),
    payload_crc: u32,
    counted: bool,
}

impl FrameHeader {
    /// Validates and decodes a header.
    ///
    /// # Errors
    /// Returns a device failure that describes the defect.
    pub fn decode(bytes: &[u8; HEADER_LEN]) -> Result<Self> {
        let bad = |what: String| Err(Error::device(format!("frame header: {what}")));
        let u32_at = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("4 bytes"));
        let u64_at = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().expect("8 bytes"));
        let u16_at = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        if bytes[..4] != MAGIC {
            return bad(format!(
                "starts with \"{}\", not with \"PHFR\": this is not a frame socket, or the stream \
                 is out of sync",
                bytes[..4].escape_ascii()
            ));
        }
        if crc32fast::hash(&bytes[..CRC_AT]) != u32_at(CRC_AT) {
            return bad("its checksum does not match".into());
        }
        if (u16_at(4), usize::from(u16_at(6))) != (VERSION, HEADER_LEN) {
            return bad(format!(
                "version {} with {} bytes, expected version {VERSION} with {HEADER_LEN}",
                u16_at(4),
                u16_at(6)
            ));
        }
        let (width, height) = (u32_at(20), u32_at(24));
        let sides = 1..=MAX_SIDE_PX;
        if !sides.contains(&width) || !sides.contains(&height) {
            return bad(format!(
                "{width} x {height} pixels, expected 1 to {MAX_SIDE_PX} each"
            ));
        }
        let code: [u8; 4] = bytes[28..32].try_into().expect("4 bytes");
        let Some(format) = PixelFormat::from_fourcc(code) else {
            return bad(format!(
                "unknown pixel format, found \"{}\"; expected {}",
                code.escape_ascii(),
                PixelFormat::ALL.map(PixelFormat::name).join(", ")
            ));
        };
        let want = format.frame_bytes(width, height) as u64;
        let payload = u64_at(48);
        if payload != want {
            return bad(format!(
                "{payload} bytes of payload, {width} x {height} pixels of {format:?} have {want}"
            ));
        }
        if payload > MAX_PAYLOAD {
            return bad(format!(
                "{payload} bytes of payload, expected at most {MAX_PAYLOAD}"
            ));
        }
        let exposure_ns = (u64_at(32), u64_at(40));
        if exposure_ns.0 > exposure_ns.1 {
            return bad("the exposure ends before it starts".into());
        }
        let flags = u32_at(60);
        if ![0, COUNTED].contains(&flags) || u32_at(64) != 0 {
            return bad("flags or reserved bytes that version 1 does not have".into());
        }
        Ok(Self {
            id: u64_at(8),
            pattern_index: Some(u32_at(16)).filter(|&index| index != NO_PATTERN),
            width,
            height,
            format,
            exposure_ns,
            payload_crc: u32_at(56),
            counted: flags == COUNTED,
        })
    }

    /// Returns the length of the payload in bytes.
    pub fn payload_len(&self) -> usize {
        self.format.frame_bytes(self.width, self.height)
    }

    /// Combines the header with its payload to a frame.
    ///
    /// # Errors
    /// Returns an error if the payload has a wrong length or checksum.
    pub fn with_payload(self, data: Vec<u8>) -> Result<Frame> {
        if data.len() != self.payload_len() || crc32fast::hash(&data) != self.payload_crc {
            return Err(Error::device(format!(
                "frame {}: its payload is damaged, the checksum does not match",
                self.id
            )));
        }
        Ok(Frame {
            id: self.id,
            pattern_index: self.pattern_index,
            width: self.width,
            height: self.height,
            format: self.format,
            exposure_start_ns: self.exposure_ns.0,
            exposure_end_ns: self.exposure_ns.1,
            data,
        })
    }
}

/// Decodes a stream of frames that arrives in pieces of any size.
#[derive(Debug)]
pub struct FrameDecoder {
    header: Option<FrameHeader>,
    /// Bytes of the header or payload; the first `filled` of them have been received.
    buffer: Vec<u8>,
    filled: usize,
    counted: bool,
}

impl Default for FrameDecoder {
    fn default() -> Self {
        Self {
            header: None,
            buffer: vec![0; HEADER_LEN],
            filled: 0,
            counted: false,
        }
    }
}

impl FrameDecoder {
    /// Returns the buffer for the stream's next bytes; it is never empty.
    pub fn space(&mut self) -> &mut [u8] {
        &mut self.buffer[self.filled..]
    }

    /// Marks the first `len` bytes of [`Self::space`] as read. Returns the frame if these bytes
    /// complete one.
    ///
    /// # Errors
    /// Returns an error if [`FrameHeader`] rejects the header or payload; [`Self::in_step`] then
    /// says whether the stream can still be read.
    pub fn advance(&mut self, len: usize) -> Result<Option<Frame>> {
        self.filled = (self.filled + len).min(self.buffer.len());
        if self.filled < self.buffer.len() {
            return Ok(None);
        }
        match self.header.take() {
            None => {
                let bytes: &[u8; HEADER_LEN] = self.buffer[..].try_into().expect("its length");
                let header = FrameHeader::decode(bytes)?;
                self.buffer = vec![0; header.payload_len()];
                self.header = Some(header);
                self.filled = 0;
                Ok(None)
            }
            Some(header) => {
                let data = std::mem::replace(&mut self.buffer, vec![0; HEADER_LEN]);
                self.filled = 0;
                self.counted = header.counted;
                header.with_payload(data).map(Some)
            }
        }
    }

    /// Returns whether the last frame came from a camera that does not identify its frames.
    pub fn counted(&self) -> bool {
        self.counted
    }

    /// Returns whether reading can continue after an error. After a damaged payload it can, because
    /// the header says where the payload ends and the next frame begins. After a damaged header the
    /// position of the next frame is unknown.
    pub fn in_step(&self) -> bool {
        self.filled < self.buffer.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn encode(frame: &Frame) -> Vec<u8> {
        [&encode_header(frame)[..], &frame.data].concat()
    }

    /// Decodes all frames of a stream that arrives in pieces of `step` bytes.
    fn decode(mut bytes: &[u8], step: usize) -> Result<Vec<Frame>> {
        let (mut decoder, mut frames) = (FrameDecoder::default(), Vec::new());
        while !bytes.is_empty() {
            let space = decoder.space();
            let len = space.len().min(step).min(bytes.len());
            space[..len].copy_from_slice(&bytes[..len]);
            bytes = &bytes[len..];
            frames.extend(decoder.advance(len)?);
        }
        Ok(frames)
    }

    prop_compose! {
        fn frames()(
            id: u64, pattern_index in proptest::option::of(0u32..u32::MAX),
            width in 1u32..20, height in 1u32..20, kind in 0usize..7,
            times in (any::<u64>(), any::<u64>()), seed: u8,
        ) -> Frame {
            let format = PixelFormat::ALL[kind];
            let len = format.frame_bytes(width, height);
            Frame {
                id, pattern_index, width, height, format,
                exposure_start_ns: times.0.min(times.1),
                exposure_end_ns: times.0.max(times.1),
                data: (0..len).map(|i| (i as u8).wrapping_mul(31) ^ seed).collect(),
            }
        }
    }

    proptest! {
        #[test]
        fn frames_decode_from_pieces_of_any_size(a in frames(), b in frames(), step in 1usize..100) {
            let bytes = [encode(&a), encode(&b)].concat();
            prop_assert_eq!(decode(&bytes, step).unwrap(), vec![a, b]);
        }

        #[test]
        fn every_flipped_bit_is_noticed(frame in frames(), at: prop::sample::Index, bit in 0u8..8) {
            let mut bytes = encode(&frame);
            let at = at.index(bytes.len());
            bytes[at] ^= 1 << bit;
            prop_assert!(decode(&bytes, 64).is_err());
        }

        #[test]
        fn any_bytes_are_refused_or_wait(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            prop_assert!(decode(&bytes, 50).map_or(true, |frames| frames.is_empty()));
        }

        /// A header with a correct checksum is validated field by field before memory is allocated.
        #[test]
        fn header_with_valid_checksum_is_still_checked(mut bytes in proptest::collection::vec(any::<u8>(), HEADER_LEN - 12)) {
            let mut header = Vec::from(MAGIC);
            header.extend([1, 0, 72, 0]);
            header.append(&mut bytes);
            header.extend(crc32fast::hash(&header).to_le_bytes());
            let header: [u8; HEADER_LEN] = header.try_into().unwrap();
            if let Ok(header) = FrameHeader::decode(&header) {
                prop_assert!(header.payload_len() as u64 <= MAX_PAYLOAD);
            }
        }
    }

    #[test]
    fn invalid_headers_are_refused_by_field() {
        let frame = Frame {
            id: 1,
            pattern_index: None,
            width: 4,
            height: 3,
            format: PixelFormat::Grey,
            exposure_start_ns: 5,
            exposure_end_ns: 9,
            data: vec![7; 12],
        };
        for (at, value, needle) in [
            (0, b'X', "PHFR"),
            (4, 2, "version 2"),
            (20, 0, "pixels"),
            (28, b'X', "pixel format"),
            (48, 13, "13 bytes of payload, 4 x 3 pixels of Grey have 12"),
            (47, 0xff, ""),
            (60, 2, "flags"),
        ] {
            let mut header = encode_header(&frame);
            header[at] = value;
            let crc = crc32fast::hash(&header[..68]);
            header[68..].copy_from_slice(&crc.to_le_bytes());
            if needle.is_empty() {
                FrameHeader::decode(&header).unwrap();
                continue;
            }
            let message = FrameHeader::decode(&header).unwrap_err().to_string();
            assert!(message.contains(needle), "{needle} not in: {message}");
        }
        let mut header = encode_header(&frame);
        for (at, value) in [(20, 16384_u32), (24, 16384), (48, 16384 * 16384)] {
            header[at..at + 4].copy_from_slice(&value.to_le_bytes());
        }
        let crc = crc32fast::hash(&header[..68]);
        header[68..].copy_from_slice(&crc.to_le_bytes());
        let message = FrameHeader::decode(&header).unwrap_err().to_string();
        let needle = "268435456 bytes of payload, expected at most 134217728";
        assert!(message.contains(needle), "{message}");
    }
}
