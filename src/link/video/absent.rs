//! Where the system has no V4L2.

use super::Put;
use crate::emulator::{Stream, StreamSink};
use crate::error::{Error, Result};
use crate::protocol::Frame;
use std::path::Path;
use std::time::Duration;

/// A camera that the kernel has; there is none.
#[derive(Debug, Clone)]
pub enum VideoOutput {}

impl VideoOutput {
    /// Refuses.
    ///
    /// # Errors
    /// Always: this build has no V4L2.
    pub fn open(path: &Path, _: &Stream, _: u32, _: Duration) -> Result<Self> {
        Err(Error::input(
            format!("--camera {}", path.display()),
            "a V4L2 device, which this build has not: it is Linux's",
            "auto or socket",
        ))
    }

    /// Finds none.
    ///
    /// # Errors
    /// Always: this build has no V4L2.
    pub fn open_any(_: &Stream, _: u32, _: Duration) -> Result<Self, String> {
        Err("this build has no V4L2".to_owned())
    }

    /// Its address.
    pub fn address(&self) -> String {
        match *self {}
    }

    /// What it is.
    pub fn about(&self) -> String {
        match *self {}
    }

    pub(in crate::link) fn put(&self, _: &Frame) -> Result<Put> {
        match *self {}
    }
}

impl StreamSink for VideoOutput {
    fn announce(&mut self, _: &Stream) -> Result<(), String> {
        match *self {}
    }
}
