//! Parsed configuration descriptors: interfaces, their alternate settings and endpoints.

use phasmid_core::error::{Error, Result};
use phasmid_protocol::usb::descriptor::{Walk, kind};

/// Transfer type of an endpoint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TransferKind {
    /// Requests and responses.
    Control,
    /// Periodic, without retransmission.
    Isochronous,
    /// Whenever the bus is free.
    Bulk,
    /// Small and infrequent.
    Interrupt,
}

/// An endpoint of an alternate setting.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Endpoint {
    /// Endpoint address: number in bits 0 to 3; bit 7 is set for transfers to the host.
    pub address: u8,
    /// Transfer type.
    pub kind: TransferKind,
    /// Maximum packet size, in bytes.
    pub max_packet: u16,
    /// Maximum number of bytes in one service interval, which is the limit of an isochronous
    /// packet.
    pub bytes_per_interval: u32,
}

/// One alternate setting of an interface.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Interface {
    /// `bInterfaceNumber`.
    pub number: u8,
    /// `bAlternateSetting`.
    pub setting: u8,
    /// Class, subclass, protocol.
    pub class: [u8; 3],
    /// Class-specific descriptors of the interface, complete.
    pub extra: Vec<Vec<u8>>,
    /// Endpoints of this setting.
    pub endpoints: Vec<Endpoint>,
}

impl Interface {
    /// Returns the first endpoint of a transfer type and direction; `input` means to the host.
    pub fn endpoint(&self, kind: TransferKind, input: bool) -> Option<&Endpoint> {
        self.endpoints
            .iter()
            .find(|e| e.kind == kind && (e.address & 0x80 != 0) == input)
    }
}

/// A configuration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Configuration {
    /// The value that selects it (`bConfigurationValue`).
    pub value: u8,
    /// Alternate settings of all interfaces, in descriptor order.
    pub interfaces: Vec<Interface>,
}

impl Configuration {
    /// Parses the descriptors.
    ///
    /// # Errors
    /// Returns an error that names the first invalid descriptor.
    pub fn parse(bytes: &[u8]) -> Result<Self> {
        Self::read(bytes).map_err(Error::device)
    }

    fn read(bytes: &[u8]) -> Result<Self, String> {
        let mut walk = Walk::new(bytes);
        let head = walk
            .next()
            .filter(|head| head.len() >= 9 && head[1] == kind::CONFIGURATION);
        let head = head.ok_or("the configuration does not begin with its descriptor")?;
        let total = usize::from(word(head, 2));
        if total != bytes.len() {
            return Err(format!("it has {} of {total} bytes", bytes.len()));
        }
        let mut interfaces: Vec<Interface> = Vec::new();
        for descriptor in walk.by_ref() {
            let bad = || format!("descriptor {descriptor:02x?} is too short or out of place");
            match descriptor[1] {
                kind::INTERFACE if descriptor.len() >= 9 => interfaces.push(Interface {
                    number: descriptor[2],
                    setting: descriptor[3],
                    class: [descriptor[5], descriptor[6], descriptor[7]],
                    extra: Vec::new(),
                    endpoints: Vec::new(),
                }),
                kind::ENDPOINT if descriptor.len() >= 7 => {
                    let interface = interfaces.last_mut().ok_or_else(bad)?;
                    interface.endpoints.push(endpoint(descriptor));
                }
                kind::ENDPOINT_COMPANION if descriptor.len() >= 6 => {
                    let endpoints = interfaces.last_mut().map(|i| &mut i.endpoints);
                    let endpoint = endpoints.and_then(|e| e.last_mut()).ok_or_else(bad)?;
                    if matches!(endpoint.kind, TransferKind::Isochronous) {
                        endpoint.bytes_per_interval = word(descriptor, 4).into();
                    }
                }
                kind::INTERFACE | kind::ENDPOINT | kind::ENDPOINT_COMPANION => return Err(bad()),
                kind::CS_INTERFACE if descriptor.len() >= 3 => {
                    // A class-specific descriptor that follows an endpoint would belong to that
                    // endpoint. The classes that are parsed here do not have such descriptors, so
                    // it belongs to the interface.
                    let interface = interfaces.last_mut().ok_or_else(bad)?;
                    interface.extra.push(descriptor.to_vec());
                }
                _ => {}
            }
        }
        if !walk.is_whole() {
            return Err("a descriptor's length is impossible".to_owned());
        }
        Ok(Self {
            value: head[5],
            interfaces,
        })
    }

    /// Returns an alternate setting of an interface.
    pub fn interface(&self, number: u8, setting: u8) -> Option<&Interface> {
        self.settings(number).find(|i| i.setting == setting)
    }

    /// Returns all alternate settings of an interface.
    pub fn settings(&self, number: u8) -> impl Iterator<Item = &Interface> {
        self.interfaces.iter().filter(move |i| i.number == number)
    }
}

fn endpoint(descriptor: &[u8]) -> Endpoint {
    let size = word(descriptor, 4);
    let max_packet = size & 0x7FF;
    Endpoint {
        address: descriptor[2],
        kind: match descriptor[3] & 3 {
            0 => TransferKind::Control,
            1 => TransferKind::Isochronous,
            2 => TransferKind::Bulk,
            _ => TransferKind::Interrupt,
        },
        max_packet,
        // High bandwidth: up to three packets per microframe (USB 2.0, table 9-13).
        bytes_per_interval: u32::from(max_packet) * (1 + u32::from(size >> 11 & 3)),
    }
}

/// Reads a little-endian 16-bit number; 0 if the descriptor ends before it.
pub(super) fn word(bytes: &[u8], at: usize) -> u16 {
    bytes
        .get(at..at + 2)
        .map_or(0, |b| u16::from_le_bytes([b[0], b[1]]))
}

/// Reads a little-endian 32-bit number; 0 if the descriptor ends before it.
pub(super) fn long(bytes: &[u8], at: usize) -> u32 {
    u32::from(word(bytes, at)) | u32::from(word(bytes, at + 2)) << 16
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn configuration() -> Vec<u8> {
        let body: [&[u8]; 5] = [
            &[9, 4, 0, 0, 1, 14, 2, 0, 0],
            &[5, 0x24, 1, 7, 7],
            &[7, 5, 0x81, 5, 0x00, 0x14, 1],
            &[9, 4, 0, 1, 1, 14, 2, 0, 0],
            &[7, 5, 0x02, 2, 0x00, 0x02, 0],
        ];
        let body = body.concat();
        [
            &[9, 2, 9 + body.len() as u8, 0, 1, 3, 0, 0x80, 50][..],
            &body,
        ]
        .concat()
    }

    #[test]
    fn interfaces_settings_and_endpoints_are_found() {
        let read = Configuration::parse(&configuration()).unwrap();
        assert_eq!(read.value, 3);
        let first = read.interface(0, 0).unwrap();
        assert_eq!(first.extra, [vec![5, 0x24, 1, 7, 7]]);
        let endpoint = first.endpoint(TransferKind::Isochronous, true).unwrap();
        assert_eq!(
            (endpoint.max_packet, endpoint.bytes_per_interval),
            (1024, 3072)
        );
        assert_eq!(first.endpoint(TransferKind::Bulk, false), None);
        let second = read.interface(0, 1).unwrap();
        assert_eq!(
            second
                .endpoint(TransferKind::Bulk, false)
                .unwrap()
                .max_packet,
            512
        );
        assert_eq!(read.settings(0).count(), 2);
        assert_eq!(read.interface(1, 0), None);
    }

    #[test]
    fn truncated_or_misordered_descriptors_are_refused() {
        let whole = configuration();
        for len in 0..whole.len() {
            assert!(Configuration::parse(&whole[..len]).is_err(), "{len}");
        }
        let lost_endpoint = [9, 2, 16, 0, 1, 1, 0, 0x80, 50, 7, 5, 0x81, 2, 0, 2, 0];
        let error = Configuration::parse(&lost_endpoint)
            .unwrap_err()
            .to_string();
        assert!(error.contains("out of place"), "{error}");
    }

    proptest! {
        #[test]
        fn any_bytes_do_not_panic(bytes: Vec<u8>, flips: [(u8, u8); 3]) {
            let _ = Configuration::parse(&bytes);
            let mut near = configuration();
            for (at, value) in flips {
                let at = usize::from(at) % near.len();
                near[at] = value;
            }
            let _ = Configuration::parse(&near);
        }
    }
}
