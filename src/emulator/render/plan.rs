//! The plan: which stages a scene and its slides need. What it leaves out changes no byte.

use super::world::World;
use crate::emulator::Slide;
use crate::geometry::View;
use crate::pattern::Axis;
use serde::Serialize;

/// Stages that run (true) or are left out (false).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Plan {
    /// The camera's rays are undistorted, from a table.
    pub camera_distortion: bool,
    /// Projector coordinates are distorted.
    pub projector_distortion: bool,
    /// Shadow rays: some object may stand in another's light, or its own.
    pub shadows: bool,
    /// Some slide varies along x: footprints along x are kept.
    pub varies_x: bool,
    /// Some slide varies along y: footprints along y are kept.
    pub varies_y: bool,
    /// Shot and read noise: random numbers are drawn.
    pub noise: bool,
}

impl Plan {
    /// Decides from the optics, the surfaces and the slides that can be asked for.
    pub(super) fn new<'a>(
        camera: &View,
        projector: &View,
        world: &World,
        slides: impl Iterator<Item = &'a Slide>,
        noise: bool,
    ) -> Self {
        let mut plan = Self {
            camera_distortion: camera.lens.is_distorted(),
            projector_distortion: projector.lens.is_distorted(),
            shadows: world.casts_shadows(),
            varies_x: false,
            varies_y: false,
            noise,
        };
        for slide in slides {
            plan.include(slide);
        }
        plan
    }

    /// Adds what a slide needs; tells whether that is more than before.
    pub(super) fn include(&mut self, slide: &Slide) -> bool {
        let before = *self;
        match slide {
            Slide::Uniform(_) => {}
            Slide::Row(Axis::X, _) => self.varies_x = true,
            Slide::Row(Axis::Y, _) => self.varies_y = true,
            Slide::Picture { .. } => (self.varies_x, self.varies_y) = (true, true),
        }
        *self != before
    }
}
