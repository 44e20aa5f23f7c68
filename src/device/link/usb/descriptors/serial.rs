//! The serial port's interfaces (CDC-ACM): control and data.

use super::configuration::{BULK, Draft, INTERRUPT, TO_HOST, interface};
use super::{FULL_SPEED_PACKET, NOTIFY_IN, SERIAL_CONTROL, SERIAL_DATA, SERIAL_IN, SERIAL_OUT};
use phasmid_protocol::usb::descriptor::{class, kind};

impl Draft {
    pub(super) fn serial(&self) -> Vec<u8> {
        let call = [5, kind::CS_INTERFACE, 1, 0, SERIAL_DATA];
        // Line coding and control lines; break.
        let abilities = [4, kind::CS_INTERFACE, 2, 0x06];
        let union = [5, kind::CS_INTERFACE, 6, SERIAL_CONTROL, SERIAL_DATA];
        // 16 ms: an exponent of microframes (2^(8-1) x 125 us), but milliseconds at full speed.
        let every = if self.packet == FULL_SPEED_PACKET {
            16
        } else {
            8
        };
        let notify = self.endpoint(TO_HOST | NOTIFY_IN, INTERRUPT, 16, every, 0);
        [
            // Abstract control model with AT commands: the class that drivers look for.
            interface(SERIAL_CONTROL, 0, 1, [class::COMMUNICATIONS, 2, 1], 5),
            // CDC 1.10.
            vec![5, kind::CS_INTERFACE, 0, 0x10, 0x01],
            call.to_vec(),
            abilities.to_vec(),
            union.to_vec(),
            notify,
            interface(SERIAL_DATA, 0, 2, [class::CDC_DATA, 0, 0], 0),
            self.endpoint(TO_HOST | SERIAL_IN, BULK, self.packet, 0, 0),
            self.endpoint(SERIAL_OUT, BULK, self.packet, 0, 0),
        ]
        .concat()
    }
}
