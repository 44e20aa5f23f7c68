//! USB/IP wire format, version 1.1.1 (the kernel's `Documentation/usb/usbip_protocol.rst`). Numbers
//! are big-endian; setup packets keep their USB encoding.
//!
//! A connection begins with one operation: listing devices or importing one. After an import it
//! carries 48-byte headers (commands from the host, replies from the device), each followed by its
//! data.

mod command;
mod device;
mod operation;
mod reply;
#[cfg(test)]
mod tests;
mod words;

pub use command::{Command, PACKET_LEN, Packet, Submit};
pub use device::{BUS_ID_LEN, DEVICE_LEN, DeviceInfo, bus_id_bytes, text};
pub use operation::{OPERATION_LEN, Operation, Outcome};
pub use reply::Reply;

/// Default port of USB/IP servers.
pub const PORT: u16 = 3240;
/// Length of a command or reply header in bytes.
pub const HEADER_LEN: usize = 48;
/// Maximum transfer size in bytes; kernel hosts stay far below it.
pub const MAX_TRANSFER: u32 = 1 << 20;
/// Maximum number of packets in an isochronous transfer, which is also the kernel's limit.
pub const MAX_PACKETS: u32 = 1024;

/// Packet count of transfers that are not isochronous.
const NO_PACKETS: u32 = u32::MAX;

pub mod status {
    //! Transfer status: negated Linux error numbers.

    /// Success.
    pub const OK: i32 = 0;
    /// EPIPE: the endpoint is halted, or the request is unsupported.
    pub const STALL: i32 = -32;
    /// ECONNRESET: cancelled before it completed.
    pub const UNLINKED: i32 = -104;
    /// EOVERFLOW: more bytes than the host has room for.
    pub const OVERFLOW: i32 = -75;
}
