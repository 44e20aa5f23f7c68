//! Exclusive use of a device by a host.

use super::device::UsbDevice;
use super::session::Session;
use phasmid_core::error::{Error, Result};

/// A device attached to a host; dropping it detaches the device, however the connection ends.
pub(super) struct Attached(UsbDevice);

impl Attached {
    /// Attaches a device.
    ///
    /// # Errors
    /// Returns an error if another host has the device or too many events wait for the firmware.
    pub(super) fn take(device: &UsbDevice) -> Result<Self> {
        if device.with(Session::attach) {
            Ok(Self(device.clone()))
        } else {
            Err(Error::device(
                "USB: device busy: attached elsewhere or not ready",
            ))
        }
    }

    pub(super) fn device(&self) -> &UsbDevice {
        &self.0
    }
}

impl Drop for Attached {
    fn drop(&mut self) {
        self.0.with(Session::detach);
    }
}
