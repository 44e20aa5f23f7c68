//! Vignetting: factors applied to the light in the geometry pass.

use crate::scene::Shaded;
use glam::{DVec2, DVec3};
use phasmid_geometry::Lens;
use phasmid_geometry::raycast::LANES;
use phasmid_profile::vignetting::half_diagonal;
use phasmid_profile::{Camera, Projector, Vignetting};

/// Vignetting factor of one lens over its field of view.
pub(crate) struct Falloff {
    pub(crate) vignetting: Vignetting,
    /// Half the diagonal of the image, in ideal image coordinates.
    pub(crate) unit: f64,
    /// Power of the cosine of the field angle that the factor contains (natural vignetting).
    pub(crate) cosines: i32,
    lens: Lens,
}

impl Falloff {
    pub(crate) fn of_camera(camera: &Camera) -> Self {
        Self::new(camera.vignetting, camera.view().lens, 4)
    }

    /// Natural vignetting has four cosines, but only one, the foreshortening of the pupil, is
    /// applied here. The light of a source with equal intensity in all directions already falls with
    /// the other three on a screen: two for the distance and one for the angle of incidence.
    pub(crate) fn of_projector(projector: &Projector) -> Self {
        Self::new(projector.vignetting, projector.view().lens, 1)
    }

    fn new(vignetting: Vignetting, lens: Lens, cosines: i32) -> Self {
        Self {
            vignetting,
            unit: half_diagonal(&lens),
            cosines,
            lens,
        }
    }

    /// Returns the factor at an ideal image point. The length of such a point vector is the tangent
    /// of the angle to the optical axis.
    pub(crate) fn at(&self, ideal: DVec2) -> f64 {
        let tangent2 = ideal.length_squared();
        let natural = if self.vignetting.natural {
            (1.0 / (1.0 + tangent2)).sqrt().powi(self.cosines)
        } else {
            1.0
        };
        // The polynomial is negative only outside the image.
        natural
            * self
                .vignetting
                .falloff_at(tangent2.sqrt() / self.unit)
                .max(0.0)
    }

    /// Dims all light on its way to the camera; `directions` have z = 1.
    pub(crate) fn dim_seen(&self, directions: &[DVec3; LANES], shaded: &mut Shaded) {
        for lane in 0..LANES {
            let factor = self.at(directions[lane].truncate());
            shaded.projected[lane] *= factor;
            shaded.ambient[lane] *= factor;
            shaded.flickering[lane] *= factor;
            shaded.evenly[lane] *= factor;
        }
    }

    /// Dims the projector's light. `shaded` must hold projector coordinates from before the
    /// distortion of the lens.
    pub(crate) fn dim_projected(&self, shaded: &mut Shaded) {
        for lane in 0..LANES {
            let px = DVec2::new(shaded.px[0][lane], shaded.px[1][lane]);
            let ideal = (px - self.lens.principal_px) / self.lens.focal_px;
            shaded.projected[lane] *= self.at(ideal);
        }
    }
}
