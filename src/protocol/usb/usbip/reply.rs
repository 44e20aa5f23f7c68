//! Replies from the device: results of transfers.

use super::words::{put_words, u32_at};
use super::{HEADER_LEN, MAX_PACKETS, MAX_TRANSFER, NO_PACKETS};
use phasmid_core::error::{Error, Result};

const RET_SUBMIT: u32 = 3;
const RET_UNLINK: u32 = 4;

/// A reply from the device. The data of a transfer to the host follows the header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reply {
    /// A transfer has ended.
    Submit {
        /// Sequence number of the transfer.
        seqnum: u32,
        /// Status code, see [`status`](super::status).
        status: i32,
        /// Bytes transferred.
        actual: u32,
        /// Number of packets of an isochronous transfer; their descriptors follow the data.
        packets: Option<u32>,
        /// Number of failed packets.
        errors: u32,
    },
    /// Result of a cancellation: [`UNLINKED`](super::status::UNLINKED), or
    /// [`OK`](super::status::OK) if the transfer had already ended.
    Unlink {
        /// Sequence number of the unlink command.
        seqnum: u32,
        /// Status code, as described above.
        status: i32,
    },
}

impl Reply {
    /// Encodes the reply's header.
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

    /// Decodes a reply's header and checks its limits.
    ///
    /// # Errors
    /// Returns an error if it is not a reply, or exceeds the byte or packet limit of a transfer.
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
                        "USB/IP reply: {actual} bytes in {packets:?} packets, expected at most \
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
                "USB/IP reply: number {reply}, expected 3 (submitted) or 4 (unlinked)"
            ))),
        }
    }
}
