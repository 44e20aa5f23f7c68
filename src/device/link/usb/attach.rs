//! Attaching a device to this machine's own kernel: one end of a socket pair goes to `vhci_hcd`
//! through its sysfs files, so that no tools of USB/IP are needed.

use super::attached::Attached;
use super::connection;
use super::device::UsbDevice;
use super::vhci::Port;
use phasmid_core::error::{Error, Result};
use std::os::fd::AsRawFd;
use std::os::unix::net::UnixStream;
use std::time::Duration;

/// A device that this machine's kernel has.
pub struct Attachment {
    device: Attached,
    port: Port,
    stream: UnixStream,
}

/// Attaches a device; it answers while [`Attachment::run`] is polled.
///
/// # Errors
/// No `vhci_hcd`, no permission, no free port of the device's speed, or a host that has it already;
/// each with what mends it.
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
    /// Where it hangs.
    pub fn port(&self) -> &Port {
        &self.port
    }

    /// Serves the kernel until it lets go. `clock` tells the time since any moment.
    ///
    /// # Errors
    /// What the system says of the socket.
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
