//! Exports USB devices over USB/IP, and attaches them to this machine's kernel.

use super::{Binding, Nodes, Port, UsbServer, attach};
use phasmid_core::error::Result;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::time::Duration;

/// Maximum time in which drivers must create the nodes of an attached device.
const NODES: Duration = Duration::from_secs(10);
const POLL: Duration = Duration::from_millis(20);

/// Options for exporting a served device as a USB device over USB/IP.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UsbServing {
    /// Address at which hosts can attach the device; USB/IP has no authentication.
    pub listen: SocketAddr,
    /// Whether to also attach the device to this machine's own kernel, which requires the necessary
    /// permission.
    pub attach: bool,
}

impl Default for UsbServing {
    /// Returns options for a free port of the loopback interface, without attaching the device.
    fn default() -> Self {
        Self {
            listen: (Ipv4Addr::LOCALHOST, 0).into(),
            attach: false,
        }
    }
}

/// A served device's connection to USB/IP.
pub struct UsbLink {
    /// The USB device and the firmware state that it shows.
    pub binding: Binding,
    /// Address at which the USB/IP server listens.
    pub listen: SocketAddr,
    /// Address from which hosts can attach the device: `usb:HOST:PORT/BUSID`.
    pub address: String,
    /// Device nodes that this machine's kernel has created for the device.
    pub nodes: Nodes,
}

/// Serves USB devices until the tokio runtime of the caller ends. Returns the links of the devices
/// in order. If the devices are attached to this machine's kernel, each link holds the device nodes
/// that drivers have created in time. `wall` returns how long the devices have been on.
///
/// # Errors
/// Returns an error if the address is in use, or if a device cannot be attached.
pub async fn export(
    bindings: Vec<Binding>,
    how: UsbServing,
    wall: impl Fn() -> Duration + Clone + Send + Sync + 'static,
) -> Result<Vec<UsbLink>> {
    let exported = bindings.iter().map(|binding| binding.device().clone());
    let server = UsbServer::bind(how.listen, exported.collect()).await?;
    let listen = server.address().unwrap_or(how.listen);
    tokio::spawn(server.run(wall.clone()));
    let nodes = match how.attach {
        false => vec![Nodes::default(); bindings.len()],
        true => attached(&bindings, wall).await?,
    };
    let links = bindings.into_iter().zip(nodes).map(|(binding, nodes)| {
        let bus_id = &binding.device().info().bus_id;
        UsbLink {
            listen,
            address: format!("usb:{}/{bus_id}", reachable(listen)),
            binding,
            nodes,
        }
    });
    Ok(links.collect())
}

/// Attaches all devices to this machine's kernel, serves them, and waits for the nodes that the
/// kernel's drivers create.
async fn attached(
    bindings: &[Binding],
    wall: impl Fn() -> Duration + Clone + Send + 'static,
) -> Result<Vec<Nodes>> {
    let mut ports = Vec::new();
    for binding in bindings {
        let attachment = attach(binding.device().clone())?;
        ports.push(attachment.port().clone());
        let wall = wall.clone();
        tokio::spawn(async move {
            // Whether the kernel detaches the device or the connection fails, the device can be
            // attached again.
            let _ = attachment.run(wall).await;
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
    fn a_server_on_all_addresses_is_reached_over_loopback() {
        let address = |address: &str| reachable(address.parse().unwrap()).to_string();
        assert_eq!(address("0.0.0.0:7"), "127.0.0.1:7");
        assert_eq!(address("[::]:7"), "[::1]:7");
        assert_eq!(address("10.0.0.1:7"), "10.0.0.1:7");
    }
}
