//! The USB devices of `--usb`, and their server.

use phasmid_core::error::{Error, Result};
use phasmid_device::Firmware;
use phasmid_device::link::usb::{Binding, Nodes, export};
use phasmid_device::link::{UsbLink, UsbServing};
use phasmid_profile::Profile;
use phasmid_protocol::usb::usbip::PORT;
use std::net::SocketAddr;
use std::time::Duration;

/// `--usb`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum UsbHow {
    /// For `usbip attach` on this or another machine.
    Export,
    /// Also attached to this machine's own kernel.
    Attach,
}

/// Parses `--usb-listen`.
pub(super) fn listen_address(text: &str) -> std::result::Result<SocketAddr, &'static str> {
    let allowed = "expected the IP address of one of this machine's interfaces and a port, such as 127.0.0.1:3240 or [::1]:0";
    text.parse().map_err(|_| allowed)
}

/// Rejects devices that a host could not distinguish.
pub(super) fn check<'a>(profiles: impl Iterator<Item = &'a Profile>) -> Result<()> {
    let profiles: Vec<_> = profiles.collect();
    // Compare these three fields, because udev derives the names of its by-id links from them.
    let id = |profile: &Profile| {
        let identity = &profile.identity;
        [&identity.manufacturer, &identity.model, &identity.serial].map(Clone::clone)
    };
    for (at, &profile) in profiles.iter().enumerate() {
        if let Some(twin) = profiles[..at].iter().find(|other| id(other) == id(profile)) {
            let found = match twin.name == profile.name {
                true => "the same profile twice".to_owned(),
                false => format!("also that of profile {}", twin.name),
            };
            return Err(Error::input(
                format!(
                    "profile {}: identity {}",
                    profile.name,
                    id(profile).join(" ")
                ),
                found,
                "a different model or serial number for each USB device of a server",
            ));
        }
    }
    Ok(())
}

/// Serves a USB device for each firmware, inside a tokio runtime. Returns the USB link of each
/// device with a description.
///
/// # Errors
/// Returns an error if the address is in use, or a device cannot be attached.
pub(super) async fn serve_usb(
    how: UsbHow,
    listen: SocketAddr,
    devices: impl Iterator<Item = (&Profile, &Firmware)>,
    clock: impl Fn() -> Duration + Clone + Send + Sync + 'static,
) -> Result<Vec<(UsbLink, String)>> {
    let bindings: Vec<Binding> = devices
        .zip(1..)
        .map(|((profile, firmware), number)| Binding::new(profile, firmware, number))
        .collect::<Result<_>>()?;
    let attach = how == UsbHow::Attach;
    let links = export(bindings, UsbServing { listen, attach }, clock).await?;
    if let Some(link) = links.first().filter(|link| !link.listen.ip().is_loopback()) {
        let listen = link.listen;
        eprintln!(
            "phasmid: USB/IP has no authentication: any host that reaches {listen} can attach the device"
        );
    }
    let described = links.into_iter().map(|link| {
        let words = match how {
            UsbHow::Export => how_to_attach(link.listen, &link.binding.device().info().bus_id),
            UsbHow::Attach => what_is_attached(&link.nodes),
        };
        (link, words)
    });
    Ok(described.collect())
}

fn what_is_attached(nodes: &Nodes) -> String {
    let lacks = match (&nodes.camera, &nodes.tty) {
        (Some(_), Some(_)) => "",
        (None, _) => ", but no camera has appeared: is uvcvideo available? run phasmid doctor",
        (_, None) => ", but no serial port has appeared: is cdc_acm available? run phasmid doctor",
    };
    format!("attached to this machine's kernel{lacks}")
}

/// Returns the command with which a host attaches a device.
fn how_to_attach(listen: SocketAddr, bus_id: &str) -> String {
    let port = match listen.port() {
        PORT => String::new(),
        port => format!("--tcp-port {port} "),
    };
    let host = match listen.ip() {
        ip if ip.is_unspecified() => "HOST".to_owned(),
        ip => ip.to_string(),
    };
    format!("a host attaches it with usbip {port}attach -r {host} -b {bus_id}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn printed_commands_can_be_used() {
        let said = |address: &str| how_to_attach(address.parse().unwrap(), "1-2");
        assert!(said("127.0.0.1:3240").ends_with("usbip attach -r 127.0.0.1 -b 1-2"));
        assert!(said("0.0.0.0:99").ends_with("usbip --tcp-port 99 attach -r HOST -b 1-2"));
    }
}
