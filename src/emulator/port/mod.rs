//! The control port's inside: what comes on the wire becomes commands of the firmware, and what it
//! answers goes out as the dialect has it.

use super::Firmware;

/// Something that the device says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    /// As it goes out on the wire.
    pub bytes: Vec<u8>,
    /// The command that it answers, as it came; `None` where nobody asked.
    pub to: Option<String>,
}

/// The device's side of a dialect.
#[derive(Debug, Default)]
pub struct Port {}

impl Port {
    /// Takes bytes that have arrived.
    pub fn receive(&mut self, bytes: &[u8], firmware: &mut Firmware, now_ns: u64) {
        firmware.receive(bytes, now_ns);
    }

    /// What the device has to say by now, in order.
    pub fn collect(&mut self, firmware: &mut Firmware, _now_ns: u64) -> Vec<Message> {
        let answered = firmware.take_answered().into_iter();
        answered
            .map(|answered| Message {
                bytes: answered.bytes,
                to: Some(answered.to),
            })
            .collect()
    }

    /// The device has been switched on.
    pub fn power_on(&mut self, _now_ns: u64) {}

    /// When the port has something to say of its own accord.
    pub fn next_event_ns(&self) -> Option<u64> {
        None
    }

    /// Forgets unfinished input and replies.
    pub fn hang_up(&mut self, firmware: &mut Firmware) {
        firmware.hang_up();
    }

    /// Whether the input stands inside of a message that has to go on without a pause.
    pub fn inside_block(&self, firmware: &Firmware) -> bool {
        firmware.inside_block()
    }

    /// Gives up on a message that stopped coming.
    pub fn input_stalled(&mut self, firmware: &mut Firmware) {
        firmware.input_stalled();
    }
}
