//! USB/IP on the wire, version 1.1.1 (the kernel's `Documentation/usb/usbip_protocol.rst`): numbers
//! are big-endian, a setup packet is as USB has it.
//!
//! A connection begins with one operation, a list of devices or the import of one. After an import
//! it carries headers of 48 bytes: commands from the host's side, replies from the device's, each
//! followed by its data.

mod command;
mod device;
mod operation;
mod packet;
mod reply;
pub mod status;
#[cfg(test)]
mod tests;
mod words;

pub use command::{Command, Submit};
pub use device::{BUS_ID_LEN, DEVICE_LEN, DeviceInfo, bus_id_bytes, text};
pub use operation::{OPERATION_LEN, Operation, Outcome};
pub use packet::{PACKET_LEN, Packet};
pub use reply::Reply;

/// Port that USB/IP servers listen on.
pub const PORT: u16 = 3240;
/// Length of a command's or a reply's header.
pub const HEADER_LEN: usize = 48;
/// Largest transfer in bytes; the kernel's hosts stay far below.
pub const MAX_TRANSFER: u32 = 1 << 20;
/// Most packets of an isochronous transfer; the kernel's own limit.
pub const MAX_PACKETS: u32 = 1024;

/// What stands for "not isochronous".
const NO_PACKETS: u32 = u32::MAX;
