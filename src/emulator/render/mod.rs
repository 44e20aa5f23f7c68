//! Rendering in three passes.

use super::{Shot, Truth};
use crate::error::Result;
use crate::profile::{Profile, Scene};
use crate::protocol::Frame;

/// Renders the frames of one camera in front of one scene.
pub struct Renderer {}

impl Renderer {
    /// Prepares a scene; `noise` off leaves the sensor's random terms out.
    ///
    /// # Errors
    /// Mesh files that cannot be read.
    pub fn new(_profile: &Profile, _scene: &Scene, _seed: u64, _noise: bool) -> Result<Self> {
        Ok(Self {})
    }

    /// The frame of one exposure.
    pub fn expose(&mut self, _shot: &Shot) -> Frame {
        todo!()
    }

    /// The truth behind the frames.
    pub fn truth(&mut self) -> Truth {
        todo!()
    }
}
