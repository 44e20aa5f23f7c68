//! The projector's defocus over depth: how wide a blur lies over each point.

use super::super::shade::Shaded;
use super::bell::Bell;
use super::soft::Soft;
use crate::geometry::raycast::LANES;
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
    /// Columns and rows of the slide.
    size: [f64; 2],
    bell: Bell,
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
            size: [view.lens.width_px, view.lens.height_px].map(f64::from),
            bell: Bell::new(),
        }
    }

    /// Dims what lies within reach of the slide's border: the part that blur takes from a
    /// footprint beyond the border brings no light. What blur carries out of the field is left out.
    pub(in super::super) fn dim_border(&self, shaded: &mut Shaded) {
        for lane in (0..LANES).filter(|&lane| shaded.reachable[lane]) {
            let sigma = self.sigma_px(DVec3::from_array(shaded.point.map(|axis| axis[lane])));
            for axis in 0..2 {
                let slope = shaded.footprint[axis].map(|by| by[lane]);
                let (low, high) = (
                    shaded.px[axis][lane] + 0.5,
                    self.size[axis] - 0.5 - shaded.px[axis][lane],
                );
                let reach = 6.0 * sigma + slope[0].abs() + slope[1].abs();
                if sigma > 0.0 && low.min(high) < reach {
                    let soft = Soft::new(&self.bell, slope, sigma);
                    let lost = |distance: f64| {
                        (soft.left_of(-distance) - soft.sharp_left_of(-distance)).max(0.0)
                    };
                    shaded.projected[lane] *= (1.0 - lost(low) - lost(high)).max(0.0);
                }
            }
        }
    }

    /// Standard deviation of the blur along each axis of the slide, in its pixels, at a point in
    /// the rig's frame.
    pub(in super::super) fn sigma_px(&self, point: DVec3) -> f64 {
        let z = self.axis.dot(point - self.pupil);
        self.strength * (self.sharp - 1.0 / z).abs()
    }
}
