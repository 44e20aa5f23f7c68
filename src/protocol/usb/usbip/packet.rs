//! Packets of isochronous transfers.

use super::words::{put_words, u32_at};

/// Length of a packet descriptor in bytes.
pub const PACKET_LEN: usize = 16;

/// One packet of an isochronous transfer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Packet {
    /// Offset in the transfer's buffer.
    pub offset: u32,
    /// Size of its buffer space in bytes.
    pub length: u32,
    /// Bytes transferred; in a reply, packet data is contiguous.
    pub actual: u32,
    /// Status code, see [`status`](super::status).
    pub status: i32,
}

impl Packet {
    /// Encodes the packet descriptor.
    pub fn encode(&self) -> [u8; PACKET_LEN] {
        let mut bytes = [0; PACKET_LEN];
        let words = [self.offset, self.length, self.actual, self.status as u32];
        put_words(&mut bytes, &words);
        bytes
    }

    /// Decodes a packet descriptor.
    pub fn decode(bytes: &[u8; PACKET_LEN]) -> Self {
        Self {
            offset: u32_at(bytes, 0),
            length: u32_at(bytes, 4),
            actual: u32_at(bytes, 8),
            status: u32_at(bytes, 12) as i32,
        }
    }
}
