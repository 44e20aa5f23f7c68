//! Commands from the host after an import: submitting and cancelling transfers; and the packets of
//! isochronous transfers.

use super::words::{put_words, u32_at};
use super::{HEADER_LEN, MAX_PACKETS, MAX_TRANSFER, NO_PACKETS};
use crate::usb::Setup;
use phasmid_core::error::{Error, Result};

const CMD_SUBMIT: u32 = 1;
const CMD_UNLINK: u32 = 2;

/// A transfer submitted by the host. Data for the device follows the header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Submit {
    /// Sequence number, which the reply repeats.
    pub seqnum: u32,
    /// Device id, see [`DeviceInfo::id`](super::DeviceInfo::id).
    pub device: u32,
    /// Whether data flows from the device to the host.
    pub input: bool,
    /// Endpoint number, 0 to 15.
    pub endpoint: u8,
    /// `transfer_flags` of the kernel's URB.
    pub flags: u32,
    /// Number of data bytes that the host sends, or for which it has room.
    pub length: u32,
    /// Number of packets of an isochronous transfer; their descriptors follow the data.
    pub packets: Option<u32>,
    /// Polling interval of the endpoint, in the kernel's units.
    pub interval: u32,
    /// Setup packet of a control transfer.
    pub setup: Setup,
}

/// A command from the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// Submits a transfer.
    Submit(Submit),
    /// Cancels a transfer.
    Unlink {
        /// Sequence number, which the reply repeats.
        seqnum: u32,
        /// Sequence number of the transfer to cancel.
        target: u32,
    },
}

impl Command {
    /// Encodes the command's header.
    pub fn encode(&self) -> [u8; HEADER_LEN] {
        let mut bytes = [0; HEADER_LEN];
        match self {
            Self::Submit(submit) => {
                let packets = submit.packets.unwrap_or(NO_PACKETS);
                put_words(
                    &mut bytes,
                    &[
                        CMD_SUBMIT,
                        submit.seqnum,
                        submit.device,
                        u32::from(submit.input),
                        submit.endpoint.into(),
                        submit.flags,
                        submit.length,
                        0,
                        packets,
                        submit.interval,
                    ],
                );
                bytes[40..].copy_from_slice(&submit.setup.encode());
            }
            Self::Unlink { seqnum, target } => {
                put_words(&mut bytes, &[CMD_UNLINK, *seqnum, 0, 0, 0, *target]);
            }
        }
        bytes
    }

    /// Decodes a command's header and checks its limits.
    ///
    /// # Errors
    /// Returns an error if it is not a command, the endpoint is invalid, or there are too many
    /// bytes or packets.
    pub fn decode(bytes: &[u8; HEADER_LEN]) -> Result<Self> {
        let bad = |what: String| Err(Error::device(format!("USB/IP command: {what}")));
        let seqnum = u32_at(bytes, 4);
        match u32_at(bytes, 0) {
            CMD_UNLINK => Ok(Self::Unlink {
                seqnum,
                target: u32_at(bytes, 20),
            }),
            CMD_SUBMIT => {
                let (direction, endpoint) = (u32_at(bytes, 12), u32_at(bytes, 16));
                let (length, packets) = (u32_at(bytes, 24), u32_at(bytes, 32));
                if direction > 1 || endpoint > 15 {
                    return bad(format!(
                        "direction {direction}, endpoint {endpoint}; expected 0 or 1, 0 to 15"
                    ));
                }
                if length > MAX_TRANSFER {
                    return bad(format!(
                        "a transfer of {length} bytes, expected at most {MAX_TRANSFER}"
                    ));
                }
                // Kernels send 0 or all ones for transfers that are not isochronous.
                let packets = (packets != NO_PACKETS && packets != 0).then_some(packets);
                if packets.is_some_and(|packets| packets > MAX_PACKETS) {
                    return bad(format!(
                        "{} packets, expected at most {MAX_PACKETS}",
                        packets.unwrap_or_default()
                    ));
                }
                Ok(Self::Submit(Submit {
                    seqnum,
                    device: u32_at(bytes, 8),
                    input: direction == 1,
                    endpoint: endpoint as u8,
                    flags: u32_at(bytes, 20),
                    length,
                    packets,
                    interval: u32_at(bytes, 36),
                    setup: Setup::decode(bytes[40..].try_into().expect("8 bytes")),
                }))
            }
            command => bad(format!(
                "number {command}, expected 1 (submit) or 2 (unlink)"
            )),
        }
    }
}

/// Length of a packet descriptor in bytes.
pub const PACKET_LEN: usize = 16;

/// One packet of an isochronous transfer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Packet {
    /// Offset in the transfer's buffer.
    pub offset: u32,
    /// Size in bytes of the packet's space in the buffer.
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
