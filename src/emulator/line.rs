//! The serial line in device time.

/// Bytes on their way in both directions.
#[derive(Debug, Default)]
pub struct SerialLine {
    to_device: Vec<u8>,
    to_host: Vec<u8>,
}

impl SerialLine {
    /// A client puts bytes on the line.
    pub fn receive(&mut self, bytes: &[u8], _now_ns: u64) {
        self.to_device.extend_from_slice(bytes);
    }

    /// Bytes that the device has by now.
    pub fn received(&mut self, _now_ns: u64) -> Vec<u8> {
        std::mem::take(&mut self.to_device)
    }

    /// The device puts bytes on the line.
    pub fn send(&mut self, bytes: &[u8], _now_ns: u64) {
        self.to_host.extend_from_slice(bytes);
    }

    /// Bytes that the client has by now.
    pub fn sent(&mut self, _now_ns: u64) -> Vec<u8> {
        std::mem::take(&mut self.to_host)
    }

    /// Forgets what is on its way.
    pub fn clear(&mut self) {
        self.to_device.clear();
        self.to_host.clear();
    }

    /// When a byte arrives next at either end.
    pub fn next_event_ns(&self) -> Option<u64> {
        None
    }
}
