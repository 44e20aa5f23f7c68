//! The projector's defocus over depth: how wide a blur lies over each point.

use crate::profile::Projector;
use glam::DVec3;

/// A thin lens's blur. The disc of [`Focus`](crate::profile::Focus) counts as the Gaussian of its
/// variance, which for a disc of diameter c is (c/4)^2 along each axis.
pub(in super::super) struct Defocus {
    pupil: DVec3,
    /// The projector's optical axis in the rig's frame.
    axis: DVec3,
    /// focal_px times aperture over 4, in mm px.
    strength: f64,
    /// 1 / focused distance.
    sharp: f64,
}

impl Defocus {
    pub(in super::super) fn new(projector: &Projector) -> Self {
        let view = projector.view();
        let (strength, sharp) = projector.focus.map_or((0.0, 0.0), |focus| {
            let strength = view.lens.focal_px.x * focus.aperture_mm / 4.0;
            (strength, 1.0 / focus.distance_mm)
        });
        Self {
            pupil: view.center(),
            axis: view.rig_from_view.rotation.z_axis,
            strength,
            sharp,
        }
    }

    /// Standard deviation of the blur along each axis of the slide, in its pixels, at a point in
    /// the rig's frame.
    pub(in super::super) fn sigma_px(&self, point: DVec3) -> f64 {
        let z = self.axis.dot(point - self.pupil);
        self.strength * (self.sharp - 1.0 / z).abs()
    }
}
