//! Operations that open a connection: listing devices or importing one.

use super::words::{u16_at, u32_at};
use phasmid_core::error::{Error, Result};

/// Length in bytes of the header of an operation.
pub const OPERATION_LEN: usize = 8;

const VERSION: u16 = 0x0111;

/// First operation of a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Operation {
    /// Lists the devices.
    List,
    /// Imports a device, whose bus id follows.
    Import,
}

/// Status of a request (the `ST_` numbers of the kernel's `usbip_common.h`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Success.
    Done,
    /// Another host has imported the device.
    Busy,
    /// No such device.
    NoDevice,
    /// Any other status number.
    Refused(u32),
}

impl Outcome {
    const fn code(self) -> u32 {
        match self {
            Self::Done => 0,
            Self::Busy => 2,
            Self::NoDevice => 4,
            Self::Refused(code) => code,
        }
    }

    const fn of(code: u32) -> Self {
        match code {
            0 => Self::Done,
            2 => Self::Busy,
            4 => Self::NoDevice,
            code => Self::Refused(code),
        }
    }
}

impl Operation {
    const fn request(self) -> u16 {
        match self {
            Self::List => 0x8005,
            Self::Import => 0x8003,
        }
    }

    /// Encodes the request header, without the data that follows.
    pub fn encode(self) -> [u8; OPERATION_LEN] {
        operation(self.request(), 0)
    }

    /// Decodes a request header.
    ///
    /// # Errors
    /// Returns an error if the protocol, version or operation is not the expected one.
    pub fn decode(bytes: [u8; OPERATION_LEN]) -> Result<Self> {
        let (version, code) = (u16_at(&bytes, 0), u16_at(&bytes, 2));
        [Self::List, Self::Import]
            .into_iter()
            .find(|operation| (VERSION, operation.request()) == (version, code))
            .ok_or_else(|| {
                Error::device(format!(
                    "USB/IP: version {version:#06x}, operation {code:#06x}; expected version \
                     {VERSION:#06x}, operation 0x8005 (list) or 0x8003 (import)"
                ))
            })
    }

    /// Encodes the reply header.
    pub fn reply(self, outcome: Outcome) -> [u8; OPERATION_LEN] {
        operation(self.request() & 0x7FFF, outcome.code())
    }

    /// Decodes a reply header.
    ///
    /// # Errors
    /// Returns an error if the protocol, version or operation is not the expected one.
    pub fn decode_reply(self, bytes: [u8; OPERATION_LEN]) -> Result<Outcome> {
        let (version, code) = (u16_at(&bytes, 0), u16_at(&bytes, 2));
        if (version, code) != (VERSION, self.request() & 0x7FFF) {
            return Err(Error::device(format!(
                "USB/IP: the answer is version {version:#06x}, operation {code:#06x}: this is not \
                 a USB/IP server"
            )));
        }
        Ok(Outcome::of(u32_at(&bytes, 4)))
    }
}

fn operation(code: u16, status: u32) -> [u8; OPERATION_LEN] {
    let mut bytes = [0; OPERATION_LEN];
    bytes[..2].copy_from_slice(&VERSION.to_be_bytes());
    bytes[2..4].copy_from_slice(&code.to_be_bytes());
    bytes[4..].copy_from_slice(&status.to_be_bytes());
    bytes
}
