//! The USB devices that `--usb` asks for, and their server.

use crate::emulator::Firmware;
use crate::error::{Error, Result};
use crate::link::UsbLink;
use crate::link::usb::{Attachment, Binding, Nodes, UsbServer, attach};
use crate::profile::Profile;
use std::net::SocketAddr;
use std::time::Duration;

/// `--usb`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum UsbHow {
    /// For `usbip attach`, here or elsewhere.
    Export,
    /// To this machine's own kernel as well.
    Attach,
}

/// How long drivers may take to make their nodes of a device that was attached.
const NODES: Duration = Duration::from_secs(5);
const POLL: Duration = Duration::from_millis(20);

/// Refuses devices that a host could not tell apart.
pub(super) fn check(profiles: &[Profile]) -> Result<()> {
    // What the nodes that udev makes by id are named after.
    let id = |profile: &'_ Profile| {
        let identity = &profile.identity;
        [&identity.manufacturer, &identity.model, &identity.serial].map(Clone::clone)
    };
    for (at, profile) in profiles.iter().enumerate() {
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

/// Serves a USB device in front of each firmware, in a tokio runtime; each comes with what to say of
/// it.
///
/// # Errors
/// An address that is taken; what is in the way of an attachment.
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
            "phasma: USB/IP has no authentication: whoever reaches {listen} can take the device"
        );
    }
    let mut links = Vec::new();
    for binding in bindings {
        let bus_id = &binding.device().info().bus_id;
        let address = format!("usb:{listen}/{bus_id}");
        let (nodes, words) = match how {
            UsbHow::Export => (
                Nodes::default(),
                format!("a host takes it with usbip attach -r HOST -b {bus_id}"),
            ),
            UsbHow::Attach => attached(attach(binding.device().clone())?, clock.clone()).await,
        };
        let link = UsbLink {
            binding,
            address,
            nodes,
        };
        links.push((link, words));
    }
    tokio::spawn(server.run(clock));
    Ok(links)
}

/// Serves the kernel, and waits for the nodes that its drivers make.
async fn attached(
    attachment: Attachment,
    clock: impl Fn() -> Duration + Send + 'static,
) -> (Nodes, String) {
    let port = attachment.port().clone();
    let served = tokio::spawn(async move {
        // The kernel lets go, or breaks off: the device can be taken again either way.
        let _ = attachment.run(clock).await;
    });
    let waited = tokio::time::timeout(NODES, async {
        while !port.nodes().is_complete() && !served.is_finished() {
            tokio::time::sleep(POLL).await;
        }
    });
    // Whether in time or not, what is there counts.
    let _ = waited.await;
    let nodes = port.nodes();
    let words = match (&nodes.camera, &nodes.tty) {
        (Some(_), Some(_)) => "attached to this machine's kernel",
        (None, _) => {
            "attached to this machine's kernel, which has made no camera of it: is there uvcvideo? run phasma doctor"
        }
        (_, None) => {
            "attached to this machine's kernel, which has made no port of it: is there cdc_acm? run phasma doctor"
        }
    };
    (nodes, words.to_owned())
}
