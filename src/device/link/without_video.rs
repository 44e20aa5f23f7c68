//! Replaces the module `video` in builds without the feature `v4l2`: no node can be opened.

use crate::{Stream, StreamSink};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::Frame;
use std::path::Path;
use std::time::Duration;

/// A loopback node that receives the device's frames. This build cannot open one.
#[derive(Clone)]
pub enum VideoOutput {}

/// Result of writing a frame.
#[derive(PartialEq)]
pub(super) enum Put {
    /// The node did not accept the frame.
    Lost,
}

impl VideoOutput {
    /// Fails, because this build cannot open a node.
    ///
    /// # Errors
    /// Returns an error that names the missing feature.
    pub fn open(path: &Path, _: &Stream, _: u32, _: Duration) -> Result<Self> {
        Err(Error::input(
            format!("--camera {}", path.display()),
            "a V4L2 node, which this build cannot open (it was built without the feature v4l2)",
            "auto or socket",
        ))
    }

    /// Fails, because this build cannot open a node.
    ///
    /// # Errors
    /// Returns an error with the reason.
    pub fn open_any(_: &Stream, _: u32, _: Duration) -> Result<Self> {
        let why = "no V4L2 node: this program was built without the feature v4l2";
        Err(Error::device(why))
    }

    /// Returns the address of the node.
    pub fn address(&self) -> String {
        match *self {}
    }

    /// Describes the node.
    pub fn about(&self) -> String {
        match *self {}
    }

    pub(in crate::link) fn put(&self, _: &Frame) -> Result<Put> {
        match *self {}
    }
}

impl StreamSink for VideoOutput {
    fn announce(&mut self, _: &Stream) -> Result<()> {
        match *self {}
    }
}
