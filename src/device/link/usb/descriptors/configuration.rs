//! The configuration descriptor, and helpers shared by its parts.

use super::{INTERFACES, Mode, SERIAL_CONTROL, VIDEO_CONTROL};
use phasmid_profile::Usb;
use phasmid_protocol::usb::descriptor::{class, kind};

/// Direction bit of an endpoint address: device to host.
pub(super) const TO_HOST: u8 = 0x80;
/// Endpoint attributes.
pub(super) const BULK: u8 = 2;
pub(super) const INTERRUPT: u8 = 3;
/// Isochronous endpoint with asynchronous synchronisation.
pub(super) const ISOCHRONOUS: u8 = 5;

/// Input for the descriptors.
#[derive(Clone, Copy)]
pub(super) struct Draft {
    pub(super) usb: Usb,
    pub(super) super_speed: bool,
    /// Maximum packet size of a bulk endpoint.
    pub(super) packet: u16,
}

impl Draft {
    /// The configuration descriptor with all its subordinate descriptors.
    pub(super) fn configuration(&self, modes: &[Mode], intervals: &[u32]) -> Vec<u8> {
        let body = [
            association(VIDEO_CONTROL, [class::VIDEO, 3, 0], 4),
            self.video_control(),
            self.video_streaming(modes, intervals),
            association(SERIAL_CONTROL, [class::COMMUNICATIONS, 2, 1], 5),
            self.serial(),
        ]
        .concat();
        let step = if self.super_speed { 8 } else { 2 };
        let power = self.usb.max_power_ma.div_ceil(step).min(255) as u8;
        let [low, high] = (9 + body.len() as u16).to_le_bytes();
        // Attributes: bus powered; bit 7 is always set.
        let head = [
            9,
            kind::CONFIGURATION,
            low,
            high,
            INTERFACES,
            1,
            0,
            0x80,
            power,
        ];
        [&head[..], &body].concat()
    }

    /// An endpoint descriptor, with its companion at SuperSpeed.
    pub(super) fn endpoint(
        &self,
        address: u8,
        kind_of: u8,
        packet: u16,
        interval: u8,
        burst: u8,
    ) -> Vec<u8> {
        let [low, high] = packet.to_le_bytes();
        let mut bytes = vec![7, kind::ENDPOINT, address, kind_of, low, high, interval];
        if self.super_speed {
            let periodic = kind_of != BULK;
            let each = if periodic {
                packet * (u16::from(burst) + 1)
            } else {
                0
            };
            let [low, high] = each.to_le_bytes();
            bytes.extend([6, kind::ENDPOINT_COMPANION, burst, 0, low, high]);
        }
        bytes
    }
}

fn association(first: u8, [class, subclass, protocol]: [u8; 3], name: u8) -> Vec<u8> {
    vec![
        8,
        kind::INTERFACE_ASSOCIATION,
        first,
        2,
        class,
        subclass,
        protocol,
        name,
    ]
}

/// An interface descriptor for one alternate setting.
pub(super) fn interface(
    number: u8,
    setting: u8,
    endpoints: u8,
    class: [u8; 3],
    name: u8,
) -> Vec<u8> {
    let [class, subclass, protocol] = class;
    vec![
        9,
        kind::INTERFACE,
        number,
        setting,
        endpoints,
        class,
        subclass,
        protocol,
        name,
    ]
}
