//! The serial class: CDC-ACM (USB Class Definitions for Communications Devices 1.2 and PSTN 1.2).

/// Class-specific requests (PSTN 1.2, table 13).
pub mod request {
    /// SET_LINE_CODING.
    pub const SET_LINE_CODING: u8 = 0x20;
    /// GET_LINE_CODING.
    pub const GET_LINE_CODING: u8 = 0x21;
    /// SET_CONTROL_LINE_STATE: sets DTR and RTS.
    pub const SET_CONTROL_LINE_STATE: u8 = 0x22;
    /// SEND_BREAK: duration in milliseconds; 0xFFFF lasts until the next request, 0 ends the break.
    pub const SEND_BREAK: u8 = 0x23;
}

/// Line coding: serial port settings (PSTN 1.2, table 17).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LineCoding {
    /// Bits per second.
    pub baud: u32,
    /// Stop bits. 0: one, 1: one and a half, 2: two.
    pub stop_bits: u8,
    /// Parity. 0: none, 1: odd, 2: even, 3: mark, 4: space.
    pub parity: u8,
    /// Data bits: 5, 6, 7, 8 or 16.
    pub data_bits: u8,
}

impl Default for LineCoding {
    /// 115,200 baud, 8 data bits, no parity, one stop bit.
    fn default() -> Self {
        Self {
            baud: 115_200,
            stop_bits: 0,
            parity: 0,
            data_bits: 8,
        }
    }
}

impl LineCoding {
    /// Length on the wire in bytes.
    pub const LEN: usize = 7;

    /// Encodes the line coding.
    pub fn encode(self) -> [u8; Self::LEN] {
        let baud = self.baud.to_le_bytes();
        [
            baud[0],
            baud[1],
            baud[2],
            baud[3],
            self.stop_bits,
            self.parity,
            self.data_bits,
        ]
    }

    /// Decodes a line coding; `None` if it is invalid.
    pub fn decode(bytes: &[u8]) -> Option<Self> {
        let bytes: [u8; Self::LEN] = bytes.try_into().ok()?;
        let coding = Self {
            baud: u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
            stop_bits: bytes[4],
            parity: bytes[5],
            data_bits: bytes[6],
        };
        let sound =
            coding.stop_bits <= 2 && coding.parity <= 4 && matches!(coding.data_bits, 5..=8 | 16);
        sound.then_some(coding)
    }
}

/// Control lines driven by the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct HostLines {
    /// Data terminal ready: set while a program has the port open.
    pub dtr: bool,
    /// Request to send.
    pub rts: bool,
}

impl HostLines {
    /// Encodes the value of SET_CONTROL_LINE_STATE.
    pub fn encode(self) -> u16 {
        u16::from(self.dtr) | u16::from(self.rts) << 1
    }

    /// Decodes the value of SET_CONTROL_LINE_STATE.
    pub fn decode(value: u16) -> Self {
        Self {
            dtr: value & 1 != 0,
            rts: value & 2 != 0,
        }
    }
}

/// Control lines driven by the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DeviceLines {
    /// Data carrier detect.
    pub dcd: bool,
    /// Data set ready.
    pub dsr: bool,
}

impl DeviceLines {
    /// Length in bytes of the notification that reports these lines.
    pub const LEN: usize = 10;

    /// Encodes a SERIAL_STATE notification of the communications interface (PSTN 1.2, 6.5.4).
    pub fn notification(self, interface: u8) -> [u8; Self::LEN] {
        let state = u8::from(self.dcd) | u8::from(self.dsr) << 1;
        [0xA1, 0x20, 0, 0, interface, 0, 2, 0, state, 0]
    }

    /// Decodes a SERIAL_STATE notification; returns `None` for any other bytes.
    pub fn from_notification(bytes: &[u8]) -> Option<Self> {
        let known = bytes.len() == Self::LEN && bytes[..2] == [0xA1, 0x20];
        known.then(|| Self {
            dcd: bytes[8] & 1 != 0,
            dsr: bytes[8] & 2 != 0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encoded_lines_and_codings_decode_equal() {
        let coding = LineCoding {
            baud: 9600,
            stop_bits: 2,
            parity: 1,
            data_bits: 7,
        };
        assert_eq!(coding.encode(), [0x80, 0x25, 0, 0, 2, 1, 7]);
        assert_eq!(LineCoding::decode(&coding.encode()), Some(coding));
        assert_eq!(LineCoding::decode(&[0; 7]), None);
        assert_eq!(LineCoding::decode(&[0; 6]), None);
        for value in 0..4 {
            assert_eq!(HostLines::decode(value).encode(), value);
        }
        let lines = DeviceLines {
            dcd: false,
            dsr: true,
        };
        let told = lines.notification(2);
        assert_eq!((told[4], told[8]), (2, 2));
        assert_eq!(DeviceLines::from_notification(&told), Some(lines));
        assert_eq!(DeviceLines::from_notification(&told[..8]), None);
    }
}
