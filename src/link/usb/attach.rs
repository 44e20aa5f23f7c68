//! Attaching a device to this machine's own kernel: one end of a socket pair goes to `vhci_hcd`
//! through its sysfs files, so that no tools of USB/IP are needed.

use super::connection;
use super::server::Attached;
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

/// Attaches a device, and serves it while the future is polled; it ends when the kernel lets go.
///
/// # Errors
/// No `vhci_hcd`, no permission, no free port of the device's speed, or a host that has it already;
/// each with what mends it.
pub async fn attach(device: UsbDevice, clock: impl Fn() -> Duration) -> Result<()> {
    let (ours, theirs) = UnixStream::pair().map_err(|e| Error::io("--usb attach", e))?;
    ours.set_nonblocking(true)
        .map_err(|e| Error::io("--usb attach", e))?;
    if !device.with(Session::attach) {
        return Err(Error::device("--usb attach: another host has the device"));
    }
    let attached = Attached(&device);
    let info = device.info();
    let port = free_port(Path::new(VHCI), info.speed)?;
    let line = format!("{port} {} {} {}", theirs.as_raw_fd(), info.id(), info.speed);
    let file = format!("{VHCI}/attach");
    fs::write(&file, line).map_err(|e| Error::io(&file, e))?;
    // The kernel has its own reference.
    drop(theirs);
    let stream = tokio::net::UnixStream::from_std(ours).map_err(|e| Error::io("USB", e))?;
    let (reader, writer) = stream.into_split();
    connection::run(reader, writer, attached.0, clock).await
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
