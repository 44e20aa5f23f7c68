//! Opens a camera by its address.

use super::socket::SocketCamera;
use super::{Camera, CameraDriver, Intake, node};
use phasmid_core::error::{Error, Result};
use std::time::Duration;

/// Valid addresses, for messages.
const ALLOWED: &str = "/dev/videoN, socket:PATH or tcp:HOST:PORT; \
     a USB device is camera and port at once: --device usb:HOST:PORT";

/// Opens a camera by its address. Waits for a V4L2 device that has no format yet because no
/// producer streams into it.
///
/// # Errors
/// Returns an error if the kind of address is unknown or does not support the capture method, or if
/// the camera cannot be reached within the timeout.
pub fn open_camera(
    address: &str,
    capture: CameraDriver,
    timeout: Duration,
) -> Result<Box<dyn Camera + Send>> {
    if address.starts_with("/dev/") {
        return node::open(address, capture, timeout);
    }
    let place = format!("--camera {address}");
    let camera = if let Some(path) = address.strip_prefix("socket:") {
        SocketCamera::connect_unix(path, address, &place)?
    } else if let Some(host) = address.strip_prefix("tcp:") {
        SocketCamera::connect_tcp(host, address, timeout, &place)?
    } else {
        return Err(Error::input(place, "an unknown kind of address", ALLOWED));
    };
    if capture != CameraDriver::Auto {
        return Err(Error::input(
            "--capture",
            format!("an option for V4L2 devices, with the camera {address}"),
            "auto for a camera behind a socket",
        ));
    }
    Ok(Box::new(Intake::new(camera)))
}
