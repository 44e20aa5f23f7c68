//! V4L2 devices, by the paths of their nodes.

mod unplugged;
mod v4l2;
mod v4l2_error;
mod webcam;

pub(super) use unplugged::open;
pub use v4l2_error::explain as explain_device;

use super::{Camera, CameraDriver, Intake};
use phasmid_core::error::Result;
use std::time::Duration;

/// Opens a V4L2 device, which cannot be found again after it was unplugged.
///
/// # Errors
/// Same as [`super::open_camera`].
fn open_node(
    address: &str,
    capture: CameraDriver,
    timeout: Duration,
) -> Result<Box<dyn Camera + Send>> {
    let found = v4l2::find(address, capture, timeout)?;
    Ok(if found.is_webcam() {
        Box::new(Intake::new(webcam::WebcamCamera::open(found)?))
    } else {
        Box::new(Intake::new(v4l2::V4l2Camera::start(found, timeout)?))
    })
}
