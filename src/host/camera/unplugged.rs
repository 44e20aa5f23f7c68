//! A camera of a USB device, which may be unplugged and come back under another name.

use super::open::{Capture, open_node};
use super::{Camera, Result};
use crate::patience::again;
use crate::plug::Plug;
use phasmid_core::error::Error;
use phasmid_protocol::Frame;
use std::time::{Duration, Instant};

/// A camera, and the device that it belongs to.
pub(super) struct PluggedCamera {
    /// `None` once it has gone: a node that is held keeps its name from its device.
    camera: Option<Box<dyn Camera>>,
    plug: Plug,
    how: Capture,
    /// As it was given.
    given: String,
    address: String,
    /// What the camera has said of its frames.
    identifies: bool,
}

impl PluggedCamera {
    /// Opens a camera; one of a USB device is found again when it has been unplugged.
    ///
    /// # Errors
    /// As for [`open_node`].
    pub(super) fn open(address: &str, how: Capture, timeout: Duration) -> Result<Box<dyn Camera>> {
        let camera = open_node(address, how, timeout)?;
        Ok(match Plug::of("video4linux", address) {
            None => camera,
            Some(plug) => Box::new(Self {
                identifies: camera.identifies(),
                camera: Some(camera),
                plug,
                how,
                given: address.to_owned(),
                address: address.to_owned(),
            }),
        })
    }
}

impl Camera for PluggedCamera {
    fn info(&self) -> &str {
        &self.address
    }

    fn next_frame(&mut self, timeout: Duration) -> Result<Option<Frame>> {
        let Some(camera) = &mut self.camera else {
            let address = &self.address;
            return Err(Error::device(format!("{address}: the device has gone")));
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
