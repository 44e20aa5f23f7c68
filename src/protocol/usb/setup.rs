//! The setup packet of a control transfer (USB 2.0, 9.3).

/// A request on the control endpoint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Setup {
    /// Direction, type and recipient. Bit 7: device to host; bits 6..5: standard, class, vendor;
    /// bits 4..0: device, interface, endpoint.
    pub kind: u8,
    /// Request code.
    pub request: u8,
    /// Parameter whose meaning depends on the request.
    pub value: u16,
    /// Parameter, often the number of an interface or endpoint.
    pub index: u16,
    /// Number of data bytes that the host sends after the packet, or requests from the device.
    pub length: u16,
}

impl Setup {
    /// Device to host, standard, recipient: device.
    pub const STANDARD_IN: u8 = 0x80;
    /// Host to device, standard, recipient: device.
    pub const STANDARD_OUT: u8 = 0x00;
    /// Host to device, standard, recipient: interface.
    pub const INTERFACE_OUT: u8 = 0x01;
    /// Device to host, standard, recipient: interface.
    pub const INTERFACE_IN: u8 = 0x81;
    /// Host to device, standard, recipient: endpoint.
    pub const ENDPOINT_OUT: u8 = 0x02;
    /// Device to host, standard, recipient: endpoint.
    pub const ENDPOINT_IN: u8 = 0x82;
    /// Host to device, class, recipient: interface.
    pub const CLASS_OUT: u8 = 0x21;
    /// Device to host, class, recipient: interface.
    pub const CLASS_IN: u8 = 0xA1;

    /// Returns whether data flows from the device to the host.
    pub fn input(self) -> bool {
        self.kind & 0x80 != 0
    }

    /// Encodes the packet.
    pub fn encode(self) -> [u8; 8] {
        let [value, index, length] = [self.value, self.index, self.length].map(u16::to_le_bytes);
        [
            self.kind,
            self.request,
            value[0],
            value[1],
            index[0],
            index[1],
            length[0],
            length[1],
        ]
    }

    /// Decodes a packet.
    pub fn decode(bytes: [u8; 8]) -> Self {
        let word = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        Self {
            kind: bytes[0],
            request: bytes[1],
            value: word(2),
            index: word(4),
            length: word(6),
        }
    }
}

/// Standard requests (USB 2.0, table 9-4; USB 3.2 adds the last two).
pub mod request {
    /// GET_STATUS.
    pub const GET_STATUS: u8 = 0;
    /// CLEAR_FEATURE.
    pub const CLEAR_FEATURE: u8 = 1;
    /// SET_FEATURE.
    pub const SET_FEATURE: u8 = 3;
    /// SET_ADDRESS.
    pub const SET_ADDRESS: u8 = 5;
    /// GET_DESCRIPTOR.
    pub const GET_DESCRIPTOR: u8 = 6;
    /// GET_CONFIGURATION.
    pub const GET_CONFIGURATION: u8 = 8;
    /// SET_CONFIGURATION.
    pub const SET_CONFIGURATION: u8 = 9;
    /// GET_INTERFACE.
    pub const GET_INTERFACE: u8 = 10;
    /// SET_INTERFACE.
    pub const SET_INTERFACE: u8 = 11;
    /// SET_SEL: exit latencies of SuperSpeed links.
    pub const SET_SEL: u8 = 48;
    /// SET_ISOCH_DELAY.
    pub const SET_ISOCH_DELAY: u8 = 49;
    /// ENDPOINT_HALT, a feature for SET_FEATURE and CLEAR_FEATURE.
    pub const ENDPOINT_HALT: u16 = 0;
}
