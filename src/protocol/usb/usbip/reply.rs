//! Replies from the device: results of transfers.

use super::words::{put_words, u32_at};
use super::{HEADER_LEN, MAX_PACKETS, MAX_TRANSFER, NO_PACKETS};
use phasmid_core::error::{Error, Result};

const RET_SUBMIT: u32 = 3;
const RET_UNLINK: u32 = 4;

/// What the device's side sends; a submitted transfer to the host is followed by its bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reply {
    /// A transfer is over.
    Submit {
        /// Number of the transfer.
        seqnum: u32,
        /// See [`status`](super::status).
        status: i32,
        /// Bytes transferred.
        actual: u32,
        /// Packets of an isochronous transfer; their descriptors follow the data.
        packets: Option<u32>,
        /// Packets that failed.
        errors: u32,
    },
    /// A transfer was taken back: [`UNLINKED`](super::status::UNLINKED), or [`OK`](super::status::OK) when it was over before.
    Unlink {
        /// Number of the unlink command.
        seqnum: u32,
        /// See above.
        status: i32,
    },
}

impl Reply {
    /// The reply in 48 bytes.
    pub fn encode(&self) -> [u8; HEADER_LEN] {
        let mut bytes = [0; HEADER_LEN];
        match *self {
            Self::Submit {
                seqnum,
                status,
                actual,
                packets,
                errors,
            } => {
                let packets = packets.unwrap_or(NO_PACKETS);
                let words = [
                    RET_SUBMIT,
                    seqnum,
                    0,
                    0,
                    0,
                    status as u32,
                    actual,
                    0,
                    packets,
                    errors,
                ];
                put_words(&mut bytes, &words);
            }
            Self::Unlink { seqnum, status } => {
                put_words(&mut bytes, &[RET_UNLINK, seqnum, 0, 0, 0, status as u32]);
            }
        }
        bytes
    }

    /// Reads and bounds a reply.
    ///
    /// # Errors
    /// Returns an error if it is not a reply, or has more bytes or packets than a transfer may
    /// have.
    pub fn decode(bytes: &[u8; HEADER_LEN]) -> Result<Self> {
        let seqnum = u32_at(bytes, 4);
        let status = u32_at(bytes, 20) as i32;
        match u32_at(bytes, 0) {
            RET_UNLINK => Ok(Self::Unlink { seqnum, status }),
            RET_SUBMIT => {
                let (actual, packets) = (u32_at(bytes, 24), u32_at(bytes, 32));
                let packets = (packets != NO_PACKETS && packets != 0).then_some(packets);
                if actual > MAX_TRANSFER || packets.is_some_and(|n| n > MAX_PACKETS) {
                    return Err(Error::device(format!(
                        "USB/IP reply: {actual} bytes in {packets:?} packets, at most \
                         {MAX_TRANSFER} in {MAX_PACKETS}"
                    )));
                }
                Ok(Self::Submit {
                    seqnum,
                    status,
                    actual,
                    packets,
                    errors: u32_at(bytes, 36),
                })
            }
            reply => Err(Error::device(format!(
                "USB/IP reply: number {reply}, want 3 (submitted) or 4 (unlinked)"
            ))),
        }
    }
}
