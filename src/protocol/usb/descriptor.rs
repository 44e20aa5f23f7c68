//! Descriptor types, and iteration over a sequence of descriptors.

/// Descriptor types (USB 2.0, table 9-5; USB 3.2, table 9-6; UVC 1.1, table A-4).
pub mod kind {
    /// DEVICE.
    pub const DEVICE: u8 = 1;
    /// CONFIGURATION.
    pub const CONFIGURATION: u8 = 2;
    /// STRING.
    pub const STRING: u8 = 3;
    /// INTERFACE.
    pub const INTERFACE: u8 = 4;
    /// ENDPOINT.
    pub const ENDPOINT: u8 = 5;
    /// DEVICE_QUALIFIER: the device's properties at its other speed.
    pub const DEVICE_QUALIFIER: u8 = 6;
    /// OTHER_SPEED_CONFIGURATION: the configuration at the other speed.
    pub const OTHER_SPEED_CONFIGURATION: u8 = 7;
    /// INTERFACE_ASSOCIATION.
    pub const INTERFACE_ASSOCIATION: u8 = 11;
    /// BOS, the binary object store.
    pub const BOS: u8 = 15;
    /// DEVICE_CAPABILITY, part of a BOS.
    pub const DEVICE_CAPABILITY: u8 = 16;
    /// CS_INTERFACE: class-specific.
    pub const CS_INTERFACE: u8 = 0x24;
    /// CS_ENDPOINT: class-specific.
    pub const CS_ENDPOINT: u8 = 0x25;
    /// SS_ENDPOINT_COMPANION.
    pub const ENDPOINT_COMPANION: u8 = 0x30;
}

/// Descriptor subtypes of the video class (UVC 1.1, tables ).
pub mod video {
    /// VC_HEADER.
    pub const CONTROL_HEADER: u8 = 1;
    /// VC_INPUT_TERMINAL.
    pub const INPUT_TERMINAL: u8 = 2;
    /// VC_OUTPUT_TERMINAL.
    pub const OUTPUT_TERMINAL: u8 = 3;
    /// VC_PROCESSING_UNIT.
    pub const PROCESSING_UNIT: u8 = 5;
    /// VS_INPUT_HEADER.
    pub const INPUT_HEADER: u8 = 1;
    /// VS_FORMAT_UNCOMPRESSED.
    pub const FORMAT_UNCOMPRESSED: u8 = 4;
    /// VS_FRAME_UNCOMPRESSED.
    pub const FRAME_UNCOMPRESSED: u8 = 5;
    /// VS_COLORFORMAT.
    pub const COLOR_FORMAT: u8 = 13;
}

/// Class codes of devices and interfaces.
pub mod class {
    /// CDC control interface.
    pub const COMMUNICATIONS: u8 = 2;
    /// CDC data interface.
    pub const CDC_DATA: u8 = 10;
    /// Video.
    pub const VIDEO: u8 = 14;
    /// Video, subclass of control interfaces.
    pub const VIDEO_CONTROL: u8 = 1;
    /// Video, subclass of streaming interfaces.
    pub const VIDEO_STREAMING: u8 = 2;
    /// Class, subclass and protocol of a composite device with interface associations.
    pub const COMPOSITE: [u8; 3] = [0xEF, 2, 1];
}

/// Iterates over consecutive descriptors. Stops early at a descriptor of invalid length; see
/// [`Walk::is_whole`].
#[derive(Debug, Clone)]
pub struct Walk<'a> {
    rest: &'a [u8],
}

impl<'a> Walk<'a> {
    /// Returns an iterator that starts at the first descriptor.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes }
    }

    /// Returns whether all bytes have been iterated over, so that no length was invalid.
    pub fn is_whole(&self) -> bool {
        self.rest.is_empty()
    }
}

impl<'a> Iterator for Walk<'a> {
    /// A descriptor: its length, its type, and the type's fields.
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        let len = usize::from(*self.rest.first()?);
        if len < 2 || len > self.rest.len() {
            return None;
        }
        let (descriptor, rest) = self.rest.split_at(len);
        self.rest = rest;
        Some(descriptor)
    }
}

/// Encodes a string descriptor with as many whole characters of `text` as its length allows.
pub fn string(text: &str) -> Vec<u8> {
    let mut units = Vec::new();
    for character in text.chars() {
        // The descriptor's length must fit into a byte, so it holds at most 126 UTF-16 units.
        if units.len() + character.len_utf16() > 126 {
            break;
        }
        units.extend_from_slice(character.encode_utf16(&mut [0; 2]));
    }
    let mut bytes = vec![2 + 2 * units.len() as u8, kind::STRING];
    bytes.extend(units.into_iter().flat_map(u16::to_le_bytes));
    bytes
}

/// Returns the text of a string descriptor; `None` for any other bytes.
pub fn text(bytes: &[u8]) -> Option<String> {
    let sound = bytes.len() >= 2
        && usize::from(bytes[0]) == bytes.len()
        && bytes[1] == kind::STRING
        && bytes.len().is_multiple_of(2);
    let units: Vec<u16> = sound.then(|| {
        let pairs = bytes[2..].chunks_exact(2);
        pairs
            .map(|pair| u16::from_le_bytes([pair[0], pair[1]]))
            .collect()
    })?;
    Some(String::from_utf16_lossy(&units))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walk_ends_at_the_end_or_at_a_broken_descriptor() {
        let bytes = [3, 4, 9, 2, 5];
        let mut walk = Walk::new(&bytes);
        assert_eq!(
            walk.by_ref().collect::<Vec<_>>(),
            [&bytes[..3], &bytes[3..]]
        );
        assert!(walk.is_whole());
        for broken in [&[0u8, 1][..], &[1, 1], &[4, 1, 1]] {
            let mut walk = Walk::new(broken);
            assert_eq!(walk.next(), None);
            assert!(!walk.is_whole());
        }
    }

    #[test]
    fn encoded_strings_decode_equal() {
        assert_eq!(string("Ph"), [6, 3, b'P', 0, b'h', 0]);
        assert_eq!(text(&string("Prüfgerät")).as_deref(), Some("Prüfgerät"));
        assert_eq!(string(&"x".repeat(500)).len(), 254);
        // Each character takes two UTF-16 units, and truncation must not split one.
        for text_before in ["", "x"] {
            let long = format!("{text_before}{}", "\u{1F9F2}".repeat(100));
            let back = text(&string(&long)).unwrap();
            assert!(
                long.starts_with(&back) && back.encode_utf16().count() >= 125,
                "{back}"
            );
        }
        assert_eq!(text(&[6, 3, 0]), None);
    }
}
