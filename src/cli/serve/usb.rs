//! The USB devices of `--usb`, and their server.

use phasmid_core::error::{Error, Result};
use phasmid_device::Firmware;
use phasmid_device::link::UsbLink;
use phasmid_device::link::usb::{Binding, Nodes, Port, UsbServer, attach};
use phasmid_profile::Profile;
use phasmid_protocol::usb::usbip::PORT;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
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

/// Maximum time for drivers to create the nodes of an attached device.
const NODES: Duration = Duration::from_secs(5);
const POLL: Duration = Duration::from_millis(20);

/// Rejects devices that a host could not distinguish.
pub(super) fn check<'a>(profiles: impl Iterator<Item = &'a Profile>) -> Result<()> {
    let profiles: Vec<_> = profiles.collect();
    // udev derives the names of its by-id links from these.
    let id = |profile: &Profile| {
        let identity = &profile.identity;
        [&identity.manufacturer, &identity.model, &identity.serial].map(Clone::clone)
    };
    for (at, &profile) in profiles.iter().enumerate() {
        if let Some(twin) = profiles[..at].iter().find(|other| id(other) == id(profile)) {
            let found = match twin.name == profile.name {
                true => "the same profile twice".to_owned(),
                false => format!("that of profile {} too", twin.name),
            };
            return Err(Error::input(
                format!(
                    "profile {}: identity {}",
                    profile.name,
                    id(profile).join(" ")
                ),
                found,
                "a model or a serial number of its own for each USB device of a server",
            ));
        }
    }
    Ok(())
}

/// Serves a USB device for each firmware, inside a tokio runtime. Returns each with a description.
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
    let exported = bindings.iter().map(|binding| binding.device().clone());
    let server = UsbServer::bind(listen, exported.collect()).await?;
    let listen = server.address().unwrap_or(listen);
    if !listen.ip().is_loopback() {
        eprintln!(
            "phasmid: USB/IP has no authentication: whoever reaches {listen} can take the device"
        );
    }
    tokio::spawn(server.run(clock.clone()));
    let nodes = match how {
        UsbHow::Export => vec![Nodes::default(); bindings.len()],
        UsbHow::Attach => attached(&bindings, clock).await?,
    };
    let links = bindings.into_iter().zip(nodes).map(|(binding, nodes)| {
        let bus_id = &binding.device().info().bus_id;
        let words = match how {
            UsbHow::Export => how_to_attach(listen, bus_id),
            UsbHow::Attach => what_is_attached(&nodes),
        };
        let address = format!("usb:{}/{bus_id}", reachable(listen));
        let link = UsbLink {
            binding,
            address,
            nodes,
        };
        (link, words)
    });
    Ok(links.collect())
}

/// Attaches all devices to this machine's kernel, serves them, and waits for the nodes that its drivers
/// create.
async fn attached(
    bindings: &[Binding],
    clock: impl Fn() -> Duration + Clone + Send + 'static,
) -> Result<Vec<Nodes>> {
    let mut ports = Vec::new();
    for binding in bindings {
        let attachment = attach(binding.device().clone())?;
        ports.push(attachment.port().clone());
        let clock = clock.clone();
        tokio::spawn(async move {
            // Whether the kernel detaches or the connection fails, the device can be attached again.
            let _ = attachment.run(clock).await;
        });
    }
    let complete = || ports.iter().all(|port| port.nodes().is_complete());
    let waited = tokio::time::timeout(NODES, async {
        while !complete() {
            tokio::time::sleep(POLL).await;
        }
    });
    // After a timeout, the nodes found so far are used.
    let _ = waited.await;
    Ok(ports.iter().map(Port::nodes).collect())
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
    format!("a host takes it with usbip {port}attach -r {host} -b {bus_id}")
}

/// Returns an address at which this machine reaches the server, even if it listens on all addresses.
fn reachable(listen: SocketAddr) -> SocketAddr {
    let loopback = match listen.ip() {
        ip if !ip.is_unspecified() => ip,
        IpAddr::V4(_) => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(_) => Ipv6Addr::LOCALHOST.into(),
    };
    SocketAddr::new(loopback, listen.port())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_and_addresses_can_be_used_as_they_are_printed() {
        let said = |address: &str| how_to_attach(address.parse().unwrap(), "1-2");
        assert!(said("127.0.0.1:3240").ends_with("usbip attach -r 127.0.0.1 -b 1-2"));
        assert!(said("0.0.0.0:99").ends_with("usbip --tcp-port 99 attach -r HOST -b 1-2"));
        let address = |address: &str| reachable(address.parse().unwrap()).to_string();
        assert_eq!(address("0.0.0.0:7"), "127.0.0.1:7");
        assert_eq!(address("[::]:7"), "[::1]:7");
        assert_eq!(address("10.0.0.1:7"), "10.0.0.1:7");
    }
}
