//! Device descriptions in list and import replies.

use super::words::{u16_at, u32_at};

/// Length of a bus id in bytes, padded with zeros.
pub const BUS_ID_LEN: usize = 32;
/// Length of a device description in bytes.
pub const DEVICE_LEN: usize = 312;

/// Device description in list and import replies.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DeviceInfo {
    /// Bus id, such as `1-1`; at most 31 bytes.
    pub bus_id: String,
    /// Bus number.
    pub bus: u32,
    /// Device number on its bus.
    pub device: u32,
    /// Speed, numbered as in the kernel: 3 high, 5 SuperSpeed.
    pub speed: u32,
    /// Vendor id.
    pub vendor: u16,
    /// Product id.
    pub product: u16,
    /// Device release number in binary-coded decimal.
    pub release: u16,
    /// Class, subclass, protocol.
    pub class: [u8; 3],
    /// Number of interfaces of the configuration.
    pub interfaces: u8,
}

impl DeviceInfo {
    /// Returns the device id used in transfers.
    pub fn id(&self) -> u32 {
        self.bus << 16 | self.device
    }

    /// Encodes the description.
    pub fn encode(&self) -> [u8; DEVICE_LEN] {
        let mut bytes = [0; DEVICE_LEN];
        let path = format!("/phasmid/{}", self.bus_id);
        put_text(&mut bytes[..256], &path);
        put_text(&mut bytes[256..288], &self.bus_id);
        bytes[288..292].copy_from_slice(&self.bus.to_be_bytes());
        bytes[292..296].copy_from_slice(&self.device.to_be_bytes());
        bytes[296..300].copy_from_slice(&self.speed.to_be_bytes());
        bytes[300..302].copy_from_slice(&self.vendor.to_be_bytes());
        bytes[302..304].copy_from_slice(&self.product.to_be_bytes());
        bytes[304..306].copy_from_slice(&self.release.to_be_bytes());
        bytes[306..309].copy_from_slice(&self.class);
        // Value of the active configuration, and number of configurations.
        bytes[309..311].copy_from_slice(&[1, 1]);
        bytes[311] = self.interfaces;
        bytes
    }

    /// Decodes a description.
    pub fn decode(bytes: &[u8; DEVICE_LEN]) -> Self {
        Self {
            bus_id: text(&bytes[256..288]),
            bus: u32_at(bytes, 288),
            device: u32_at(bytes, 292),
            speed: u32_at(bytes, 296),
            vendor: u16_at(bytes, 300),
            product: u16_at(bytes, 302),
            release: u16_at(bytes, 304),
            class: [bytes[306], bytes[307], bytes[308]],
            interfaces: bytes[311],
        }
    }
}

/// Encodes a bus id.
pub fn bus_id_bytes(bus_id: &str) -> [u8; BUS_ID_LEN] {
    let mut bytes = [0; BUS_ID_LEN];
    put_text(&mut bytes, bus_id);
    bytes
}

/// Decodes a zero-padded text; invalid UTF-8 is replaced.
pub fn text(bytes: &[u8]) -> String {
    let used = bytes.split(|byte| *byte == 0).next().unwrap_or_default();
    String::from_utf8_lossy(used).into_owned()
}

/// Writes a text, truncated so that at least one zero follows it.
fn put_text(bytes: &mut [u8], text: &str) {
    let len = text.len().min(bytes.len() - 1);
    bytes[..len].copy_from_slice(&text.as_bytes()[..len]);
}
