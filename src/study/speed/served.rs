//! A device that is served within the process, as `phasmid serve --clock fast` serves one.

use super::links::Missing;
use phasmid_core::error::Result;
use phasmid_device::Device;
use phasmid_device::link::{CameraNode, ServeOptions, Serving, Tcp, UsbServing};
use phasmid_profile::{Profile, Scene};
use phasmid_protocol::service::ClockPace;
use std::path::Path;

/// How frames leave besides the frame socket.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// Not at all.
    None,
    /// A TCP port of the loopback interface.
    Tcp,
    /// A USB device, served over USB/IP on the loopback interface.
    Usb,
    /// The same, handed to this machine's kernel as well.
    Kernel,
    /// The first free V4L2 node that is labelled for it.
    Video,
}

/// Serves a device from a directory of its own.
///
/// # Errors
/// Nodes that this machine does not have; ports and sockets that the system refuses.
pub fn serve(
    profile: &Profile,
    scene: &Scene,
    seed: u64,
    exit: Exit,
    dir: &Path,
) -> Result<Serving, Missing> {
    let device = Device::builder(profile, scene).seed(seed).build()?;
    let usb = |attach| UsbServing {
        attach,
        ..UsbServing::default()
    };
    let options = ServeOptions {
        run_dir: Some(dir.to_owned()),
        clock: match exit {
            Exit::Video => ClockPace::Real,
            _ => ClockPace::Fast,
        },
        tcp: (exit == Exit::Tcp).then_some(Tcp {
            port: 0,
            token: None,
        }),
        camera: match exit {
            Exit::Video => CameraNode::Any,
            _ => CameraNode::None,
        },
        usb: match exit {
            Exit::Usb => Some(usb(false)),
            Exit::Kernel => Some(usb(true)),
            _ => None,
        },
        ..ServeOptions::default()
    };
    let lacks_node = |serving: &Serving| {
        let at = serving.endpoints();
        exit == Exit::Kernel && (at.control_usb.is_none() || !at.camera.starts_with("/dev/"))
    };
    match device.serve(&options) {
        Ok(serving) if lacks_node(&serving) => {
            let why = "the kernel's drivers have not made both nodes of the USB device";
            Err(Missing::Lack(why.to_owned()))
        }
        Ok(serving) => Ok(serving),
        Err(e) if matches!(exit, Exit::Kernel | Exit::Video) => Err(Missing::Lack(e.to_string())),
        Err(e) => Err(e.into()),
    }
}
