//! Opens V4L2 devices. A USB camera may be unplugged and come back under another node name.

use super::{Camera, CameraDriver, Intake, v4l2, webcam};
use crate::plug::Plug;
use crate::time::again;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::Frame;
use std::time::{Duration, Instant};

/// A camera and the USB device that it belongs to.
struct PluggedCamera {
    /// `None` once the camera is gone: if its node stayed open, the node's name would remain
    /// occupied, and the device would come back under another name.
    camera: Option<Box<dyn Camera + Send>>,
    plug: Plug,
    how: CameraDriver,
    /// The address as given.
    given: String,
    address: String,
    /// Last known answer of [`Camera::identifies`].
    identifies: bool,
}

/// Opens a V4L2 device. If it belongs to a USB device, it can be found again after being unplugged.
///
/// # Errors
/// Same as [`crate::open_camera`].
pub(in crate::camera) fn open(
    address: &str,
    how: CameraDriver,
    timeout: Duration,
) -> Result<Box<dyn Camera + Send>> {
    let camera = open_node(address, how, timeout)?;
    Ok(match Plug::of("video4linux", address) {
        None => camera,
        Some(plug) => Box::new(PluggedCamera {
            identifies: camera.identifies(),
            camera: Some(camera),
            plug,
            how,
            given: address.to_owned(),
            address: address.to_owned(),
        }),
    })
}

/// Opens a V4L2 device without the ability to find it again after it was unplugged.
///
/// # Errors
/// Same as [`crate::open_camera`].
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

impl Camera for PluggedCamera {
    fn info(&self) -> &str {
        &self.address
    }

    fn next_frame(&mut self, timeout: Duration) -> Result<Option<Frame>> {
        let Some(camera) = &mut self.camera else {
            let address = &self.address;
            return Err(Error::device(format!("{address}: the device disconnected")));
        };
        let frame = camera.next_frame(timeout);
        self.identifies = camera.identifies();
        if frame.is_err() && !camera.has_skipped() {
            self.camera = None;
        }
        frame
    }

    fn has_skipped(&self) -> bool {
        self.camera
            .as_ref()
            .is_some_and(|camera| camera.has_skipped())
    }

    fn identifies(&self) -> bool {
        self.identifies
    }

    fn has_gone(&self) -> bool {
        self.camera.is_none()
    }

    fn reopen(&mut self, timeout: Duration) -> Result<()> {
        let end = Instant::now() + timeout;
        self.camera = None;
        again(timeout, || {
            let address = self.plug.path(&self.given)?;
            let left = end.saturating_duration_since(Instant::now());
            let camera = open_node(&address, self.how, left)?;
            self.identifies = camera.identifies();
            self.camera = Some(camera);
            self.address = address;
            Ok(())
        })
    }
}
