//! Input of the geometry pass.

use super::aperture::Aperture;
use super::rays::Rays;
use crate::exposure::Optics;
use crate::scene::{Occluders, Worlds};
use crate::{Options, Plan, Term};

/// Scene, camera and settings of a geometry pass.
#[derive(Clone, Copy)]
pub(crate) struct Input<'a> {
    pub(crate) worlds: &'a Worlds,
    pub(crate) optics: &'a Optics,
    pub(crate) rays: &'a Rays<'a>,
    pub(crate) plan: &'a Plan,
    pub(crate) options: Options,
    pub(crate) aperture: Aperture,
    /// Possible occluders of points that are seen from the rig's origin; `None` until they have been
    /// searched for.
    pub(crate) occluders: Option<&'a Occluders>,
}

/// Number of triangles per camera pixel above which shadow rays cost less than the search for
/// occluders.
const MOST_TRIANGLES: usize = 8;

impl<'a> Input<'a> {
    /// Returns the same input with possible occluders.
    pub(super) fn with<'b>(&self, occluders: Option<&'b Occluders>) -> Input<'b>
    where
        'a: 'b,
    {
        Input { occluders, ..*self }
    }

    /// Searches for possible occluders, if all rows see the scene at one instant.
    pub(super) fn find_occluders(&self) -> Option<Occluders> {
        let (world, lens) = (self.worlds.any(), &self.optics.camera.lens);
        let pixels = lens.width_px as usize * lens.height_px as usize;
        let wanted = self.plan.has(Term::Shadows)
            && self.worlds.rows_together() > 1
            && world.triangle_count() <= MOST_TRIANGLES * pixels;
        wanted.then(|| Occluders::new(world, &self.optics.projector))
    }
}
