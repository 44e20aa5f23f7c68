//! Attaches a device to the local kernel: one end of a socket pair goes to `vhci_hcd` through its
//! sysfs files, so that no USB/IP tools are needed.

use super::connection;
use super::device::{Attached, UsbDevice};
use super::vhci::Port;
use phasmid_core::error::{Error, Result};
use std::os::fd::AsRawFd;
use std::os::unix::net::UnixStream;
use std::time::Duration;

/// A device attached to the local kernel.
pub struct Attachment {
    device: Attached,
    port: Port,
    stream: UnixStream,
}

/// Attaches a device to the local kernel. The device answers the kernel only while
/// [`Attachment::run`] is polled.
///
/// # Errors
/// Returns an error with a remedy if `vhci_hcd` is not loaded, permission is denied, all ports of
/// the device's speed are in use, or another host has attached the device.
pub fn attach(device: UsbDevice) -> Result<Attachment> {
    let (ours, theirs) = UnixStream::pair().map_err(|e| Error::io("--usb attach", e))?;
    ours.set_nonblocking(true)
        .map_err(|e| Error::io("--usb attach", e))?;
    let info = device.info().clone();
    let port = Port::free(info.speed)?;
    let attachment = Attachment {
        device: Attached::take(&device)?,
        port,
        stream: ours,
    };
    attachment
        .port
        .attach(theirs.as_raw_fd(), info.id(), info.speed)?;
    Ok(attachment)
}

impl Attachment {
    /// Returns the port that the device is attached to.
    pub fn port(&self) -> &Port {
        &self.port
    }

    /// Serves the kernel until it detaches the device. `clock` returns the time since an arbitrary
    /// fixed point in time.
    ///
    /// # Errors
    /// Returns an error if the socket fails.
    pub async fn run(self, clock: impl Fn() -> Duration) -> Result<()> {
        let stream = self
            .stream
            .try_clone()
            .and_then(tokio::net::UnixStream::from_std);
        let stream = stream.map_err(|e| Error::io("--usb attach", e))?;
        let (reader, writer) = stream.into_split();
        connection::run(reader, writer, self.device.device(), clock).await
    }
}
