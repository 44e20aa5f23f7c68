//! Attaching a device to this machine's own kernel: one end of a socket pair goes to `vhci_hcd`
//! through its sysfs files, so that no tools of USB/IP are needed.

use super::connection;
use super::session::{Session, UsbDevice};
use crate::error::{Error, Result};
use std::fs;
use std::os::fd::AsRawFd;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

/// The first controller's files.
const VHCI: &str = "/sys/devices/platform/vhci_hcd.0";
/// State of a port that nothing is attached to.
const FREE: &str = "004";

/// A device that this machine's kernel has.
pub struct Attachment {
    device: UsbDevice,
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
    let port = free_port(Path::new(VHCI), info.speed)?;
    if !device.with(Session::attach) {
        return Err(Error::device("--usb attach: another host has the device"));
    }
    let attachment = Attachment {
        device,
        stream: ours,
    };
    let line = format!("{port} {} {} {}", theirs.as_raw_fd(), info.id(), info.speed);
    let file = format!("{VHCI}/attach");
    // The kernel takes a reference of its own to the other end.
    fs::write(&file, line).map_err(|e| Error::io(&file, e))?;
    Ok(attachment)
}

impl Attachment {
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
        connection::run(reader, writer, &self.device, clock).await
    }
}

impl Drop for Attachment {
    fn drop(&mut self) {
        self.device.with(Session::detach);
    }
}

/// A port of the controller that is free and has the speed.
fn free_port(vhci: &Path, speed: u32) -> Result<u32> {
    let file = vhci.join("status");
    let text = fs::read_to_string(&file).map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => Error::device(
            "--usb attach: this kernel has no virtual USB host controller; `sudo modprobe vhci-hcd` loads it",
        ),
        _ => Error::io(&file, e),
    })?;
    find_port(&text, speed).ok_or_else(|| {
        Error::device(format!(
            "--usb attach: all ports of {} are taken, `usbip port` lists them",
            vhci.display()
        ))
    })
}

/// The first free port in the controller's table: hub, port, state and what is of no interest.
fn find_port(table: &str, speed: u32) -> Option<u32> {
    let hub = if speed >= 5 { "ss" } else { "hs" };
    table.lines().find_map(|line| {
        let mut words = line.split_whitespace();
        let free = words.next() == Some(hub);
        let port = words.next()?.parse().ok()?;
        (free && words.next() == Some(FREE)).then_some(port)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As a kernel 6.1 prints it, shortened.
    const TABLE: &str = "hub port sta spd dev      sockfd local_busid\n\
        hs  0000 006 003 00010002 000003 1-1\n\
        hs  0001 004 000 00000000 000000 0-0\n\
        ss  0008 004 000 00000000 000000 0-0\n";

    #[test]
    fn ports_are_chosen_by_speed_and_state() {
        assert_eq!(find_port(TABLE, 3), Some(1));
        assert_eq!(find_port(TABLE, 5), Some(8));
        assert_eq!(find_port("hub port sta\n", 3), None);
        let error = free_port(Path::new("/no/such"), 3).unwrap_err();
        assert!(error.to_string().contains("modprobe"), "{error}");
    }
}
