//! USB/IP on the wire, version 1.1.1 (the kernel's `Documentation/usb/usbip_protocol.rst`): numbers
//! are big-endian, a setup packet is as USB has it.
//!
//! A connection begins with one operation, a list of devices or the import of one. After an import
//! it carries headers of 48 bytes: commands from the host's side, replies from the device's, each
//! followed by its data.

use super::Setup;
use crate::error::{Error, Result};

/// Port that USB/IP servers listen on.
pub const PORT: u16 = 3240;
/// Length of a command's or a reply's header.
pub const HEADER_LEN: usize = 48;
/// Length of an operation's header.
pub const OPERATION_LEN: usize = 8;
/// Length of a device's name on its bus, with zeros behind it.
pub const BUS_ID_LEN: usize = 32;
/// Length of a device in a list or an import.
pub const DEVICE_LEN: usize = 312;
/// Largest transfer in bytes; the kernel's hosts stay far below.
pub const MAX_TRANSFER: u32 = 1 << 20;
/// Most packets of an isochronous transfer; the kernel's own limit.
pub const MAX_PACKETS: u32 = 1024;
/// Length of an isochronous packet's descriptor.
pub const PACKET_LEN: usize = 16;

const VERSION: u16 = 0x0111;
const CMD_SUBMIT: u32 = 1;
const CMD_UNLINK: u32 = 2;
const RET_SUBMIT: u32 = 3;
const RET_UNLINK: u32 = 4;
/// What stands for "not isochronous".
const NO_PACKETS: u32 = u32::MAX;

/// Status of a transfer: negative error numbers of Linux.
pub mod status {
    /// Done.
    pub const OK: i32 = 0;
    /// EPIPE: the endpoint is halted, or the request is not known.
    pub const STALL: i32 = -32;
    /// ECONNRESET: unlinked before it was done.
    pub const UNLINKED: i32 = -104;
    /// ESHUTDOWN: the device goes.
    pub const SHUTDOWN: i32 = -108;
    /// EOVERFLOW: more bytes than the host has room for.
    pub const OVERFLOW: i32 = -75;
    /// ENODEV: no such device.
    pub const NO_DEVICE: i32 = -19;
}

/// What a connection begins with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Operation {
    /// Which devices are there?
    List,
    /// This one, please; its name on the bus follows.
    Import,
}

impl Operation {
    const fn request(self) -> u16 {
        match self {
            Self::List => 0x8005,
            Self::Import => 0x8003,
        }
    }

    /// The operation's request, without what follows it.
    pub fn encode(self) -> [u8; OPERATION_LEN] {
        operation(self.request(), 0)
    }

    /// Reads a request.
    ///
    /// # Errors
    /// Another protocol, version or operation.
    pub fn decode(bytes: [u8; OPERATION_LEN]) -> Result<Self> {
        let (version, code) = (u16_at(&bytes, 0), u16_at(&bytes, 2));
        [Self::List, Self::Import]
            .into_iter()
            .find(|operation| (VERSION, operation.request()) == (version, code))
            .ok_or_else(|| {
                Error::device(format!(
                    "USB/IP: version {version:#06x}, operation {code:#06x}; want version \
                     {VERSION:#06x}, operation 0x8005 (list) or 0x8003 (import)"
                ))
            })
    }

    /// The reply's header; `found` is whether the request can be met.
    pub fn reply(self, found: bool) -> [u8; OPERATION_LEN] {
        operation(self.request() & 0x7FFF, u32::from(!found))
    }

    /// Reads the reply's header: whether the request can be met.
    ///
    /// # Errors
    /// Another protocol, version or operation.
    pub fn decode_reply(self, bytes: [u8; OPERATION_LEN]) -> Result<bool> {
        let (version, code) = (u16_at(&bytes, 0), u16_at(&bytes, 2));
        if (version, code) != (VERSION, self.request() & 0x7FFF) {
            return Err(Error::device(format!(
                "USB/IP: the answer is version {version:#06x}, operation {code:#06x}: this is no USB/IP server"
            )));
        }
        Ok(u32_at(&bytes, 4) == 0)
    }
}

fn operation(code: u16, status: u32) -> [u8; OPERATION_LEN] {
    let mut bytes = [0; OPERATION_LEN];
    bytes[..2].copy_from_slice(&VERSION.to_be_bytes());
    bytes[2..4].copy_from_slice(&code.to_be_bytes());
    bytes[4..].copy_from_slice(&status.to_be_bytes());
    bytes
}

/// A device as lists and imports show it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DeviceInfo {
    /// Name on the bus, such as `1-1`; at most 31 bytes.
    pub bus_id: String,
    /// Number of the bus.
    pub bus: u32,
    /// Number of the device on its bus.
    pub device: u32,
    /// Speed as the kernel numbers it: 3 high, 5 SuperSpeed.
    pub speed: u32,
    /// Vendor id.
    pub vendor: u16,
    /// Product id.
    pub product: u16,
    /// Release of the device, binary coded decimal.
    pub release: u16,
    /// Class, subclass, protocol.
    pub class: [u8; 3],
    /// Interfaces of the configuration.
    pub interfaces: u8,
}

impl DeviceInfo {
    /// Number by which transfers name the device.
    pub fn id(&self) -> u32 {
        self.bus << 16 | self.device
    }

    /// The device in 312 bytes.
    pub fn encode(&self) -> [u8; DEVICE_LEN] {
        let mut bytes = [0; DEVICE_LEN];
        let path = format!("/phasma/{}", self.bus_id);
        put_text(&mut bytes[..256], &path);
        put_text(&mut bytes[256..288], &self.bus_id);
        bytes[288..292].copy_from_slice(&self.bus.to_be_bytes());
        bytes[292..296].copy_from_slice(&self.device.to_be_bytes());
        bytes[296..300].copy_from_slice(&self.speed.to_be_bytes());
        bytes[300..302].copy_from_slice(&self.vendor.to_be_bytes());
        bytes[302..304].copy_from_slice(&self.product.to_be_bytes());
        bytes[304..306].copy_from_slice(&self.release.to_be_bytes());
        bytes[306..309].copy_from_slice(&self.class);
        // The value of the configuration that is set, and how many there are.
        bytes[309..311].copy_from_slice(&[1, 1]);
        bytes[311] = self.interfaces;
        bytes
    }

    /// Reads a device.
    pub fn decode(bytes: &[u8; DEVICE_LEN]) -> Self {
        Self {
            bus_id: text(&bytes[256..288]),
            bus: u32_at(bytes, 288),
            device: u32_at(bytes, 292),
            speed: u32_at(bytes, 296),
            vendor: u16_at(bytes, 300),
            product: u16_at(bytes, 302),
            release: u16_at(bytes, 304),
            class: [bytes[306], bytes[307], bytes[308]],
            interfaces: bytes[311],
        }
    }
}

/// A name on the bus in its 32 bytes.
pub fn bus_id_bytes(bus_id: &str) -> [u8; BUS_ID_LEN] {
    let mut bytes = [0; BUS_ID_LEN];
    put_text(&mut bytes, bus_id);
    bytes
}

/// A text with zeros behind it; what is no UTF-8 is replaced.
pub fn text(bytes: &[u8]) -> String {
    let used = bytes.split(|byte| *byte == 0).next().unwrap_or_default();
    String::from_utf8_lossy(used).into_owned()
}

/// Cut so that at least one zero stays behind it.
fn put_text(bytes: &mut [u8], text: &str) {
    let len = text.len().min(bytes.len() - 1);
    bytes[..len].copy_from_slice(&text.as_bytes()[..len]);
}

/// A transfer that the host asks for; a transfer to the device is followed by its bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Submit {
    /// Number by which the reply names it.
    pub seqnum: u32,
    /// [`DeviceInfo::id`].
    pub device: u32,
    /// From the device to the host.
    pub input: bool,
    /// Number of the endpoint, 0 to 15.
    pub endpoint: u8,
    /// `transfer_flags` of the kernel's URB.
    pub flags: u32,
    /// Bytes that the host sends or has room for.
    pub length: u32,
    /// Packets of an isochronous transfer; their descriptors follow the data.
    pub packets: Option<u32>,
    /// Interval of the endpoint as the kernel counts it.
    pub interval: u32,
    /// The request of a control transfer.
    pub setup: Setup,
}

/// What the host's side sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// A transfer.
    Submit(Submit),
    /// Takes a transfer back.
    Unlink {
        /// Number by which the reply names it.
        seqnum: u32,
        /// The transfer's number.
        target: u32,
    },
}

impl Command {
    /// The command in 48 bytes.
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

    /// Reads and bounds a command.
    ///
    /// # Errors
    /// Something else, an endpoint that cannot be, more bytes or packets than are taken.
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
                        "direction {direction}, endpoint {endpoint}; want 0 or 1, 0 to 15"
                    ));
                }
                if length > MAX_TRANSFER {
                    return bad(format!(
                        "a transfer of {length} bytes, at most {MAX_TRANSFER}"
                    ));
                }
                // Kernels say 0 or all ones where nothing is isochronous.
                let packets = (packets != NO_PACKETS && packets != 0).then_some(packets);
                if packets.is_some_and(|packets| packets > MAX_PACKETS) {
                    return bad(format!(
                        "{} packets, at most {MAX_PACKETS}",
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
            command => bad(format!("number {command}, want 1 (submit) or 2 (unlink)")),
        }
    }
}

/// What the device's side sends; a submitted transfer to the host is followed by its bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reply {
    /// A transfer is over.
    Submit {
        /// Number of the transfer.
        seqnum: u32,
        /// See [`status`].
        status: i32,
        /// Bytes transferred.
        actual: u32,
        /// Packets of an isochronous transfer; their descriptors follow the data.
        packets: Option<u32>,
        /// Packets that failed.
        errors: u32,
    },
    /// A transfer was taken back: [`status::UNLINKED`], or [`status::OK`] when it was over before.
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
    /// Something else, more bytes or packets than a transfer may have.
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

/// One packet of an isochronous transfer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Packet {
    /// Where it lies in the transfer's buffer.
    pub offset: u32,
    /// Its room.
    pub length: u32,
    /// Its bytes; in a reply they follow each other without gaps.
    pub actual: u32,
    /// See [`status`].
    pub status: i32,
}

impl Packet {
    /// The packet's descriptor.
    pub fn encode(&self) -> [u8; PACKET_LEN] {
        let mut bytes = [0; PACKET_LEN];
        let words = [self.offset, self.length, self.actual, self.status as u32];
        put_words(&mut bytes, &words);
        bytes
    }

    /// Reads a packet's descriptor.
    pub fn decode(bytes: &[u8; PACKET_LEN]) -> Self {
        Self {
            offset: u32_at(bytes, 0),
            length: u32_at(bytes, 4),
            actual: u32_at(bytes, 8),
            status: u32_at(bytes, 12) as i32,
        }
    }
}

fn put_words(bytes: &mut [u8], words: &[u32]) {
    for (place, word) in bytes.chunks_exact_mut(4).zip(words) {
        place.copy_from_slice(&word.to_be_bytes());
    }
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_be_bytes([bytes[at], bytes[at + 1]])
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_be_bytes(bytes[at..at + 4].try_into().expect("4 bytes"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The example of an import and a transfer in the kernel's documentation.
    #[test]
    fn reads_as_the_kernel_documents() {
        assert_eq!(
            Operation::Import.encode(),
            [0x01, 0x11, 0x80, 0x03, 0, 0, 0, 0]
        );
        let mut submit = [0u8; HEADER_LEN];
        for (at, word) in [
            (0, 1u32),
            (4, 0x0d05),
            (8, 0x0001_000f),
            (12, 1),
            (16, 1),
            (20, 0x200),
            (24, 0x40),
            (32, u32::MAX),
            (36, 4),
        ] {
            submit[at..at + 4].copy_from_slice(&word.to_be_bytes());
        }
        let Command::Submit(read) = Command::decode(&submit).unwrap() else {
            panic!("a submit");
        };
        assert_eq!((read.seqnum, read.device), (0x0d05, 0x0001_000f));
        assert_eq!((read.input, read.endpoint, read.length), (true, 1, 64));
        assert_eq!((read.packets, read.interval), (None, 4));
        assert_eq!(Command::Submit(read).encode(), submit);
    }

    proptest! {
        #[test]
        fn commands_and_replies_come_back(words: [u32; 12]) {
            let mut bytes = [0u8; HEADER_LEN];
            put_words(&mut bytes, &words);
            bytes[3] %= 5;
            bytes[..3].fill(0);
            if let Ok(command) = Command::decode(&bytes) {
                prop_assert_eq!(Command::decode(&command.encode()).unwrap(), command);
                if let Command::Submit(submit) = command {
                    prop_assert!(submit.length <= MAX_TRANSFER && submit.endpoint < 16);
                    prop_assert!(submit.packets.is_none_or(|packets| packets <= MAX_PACKETS));
                }
            }
            if let Ok(reply) = Reply::decode(&bytes) {
                prop_assert_eq!(Reply::decode(&reply.encode()).unwrap(), reply);
            }
        }

        #[test]
        fn devices_come_back(bus_id in "[0-9]{1,3}-[0-9]{1,3}", numbers: [u32; 3], ids: [u16; 3]) {
            let device = DeviceInfo {
                bus_id,
                bus: numbers[0],
                device: numbers[1],
                speed: numbers[2],
                vendor: ids[0],
                product: ids[1],
                release: ids[2],
                class: [0xEF, 2, 1],
                interfaces: 4,
            };
            prop_assert_eq!(DeviceInfo::decode(&device.encode()), device);
        }
    }

    #[test]
    fn other_protocols_and_sizes_are_refused() {
        let list = Operation::List.encode();
        assert!(Operation::decode(*b"GET / HT").is_err());
        assert_eq!(Operation::decode(list).unwrap(), Operation::List);
        assert!(Operation::List.decode_reply(list).is_err());
        assert!(
            !Operation::Import
                .decode_reply(Operation::Import.reply(false))
                .unwrap()
        );
        let mut huge = Command::Submit(Submit {
            seqnum: 1,
            device: 2,
            input: true,
            endpoint: 1,
            flags: 0,
            length: MAX_TRANSFER,
            packets: Some(MAX_PACKETS),
            interval: 0,
            setup: Setup::default(),
        })
        .encode();
        assert!(Command::decode(&huge).is_ok());
        huge[27] = 1;
        assert!(
            Command::decode(&huge)
                .unwrap_err()
                .to_string()
                .contains("bytes")
        );
        huge[27] = 0;
        huge[35] = 1;
        assert!(
            Command::decode(&huge)
                .unwrap_err()
                .to_string()
                .contains("packets")
        );
    }
}
