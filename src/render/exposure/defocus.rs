//! Projector defocus: width of the blur as a function of the depth of a point.

use super::bell::Bell;
use super::bell::Soft;
use crate::scene::Shaded;
use glam::DVec3;
use phasmid_geometry::raycast::LANES;
use phasmid_profile::Projector;

/// Blur of a thin lens. The disc of [`Focus`](phasmid_profile::Focus) is approximated by a Gaussian
/// of equal variance, (c/4)^2 along each axis for a disc of diameter c. While a fringe keeps at
/// least six tenths of its contrast, its contrasts under disc and Gaussian agree within 0.03
/// (tested). For stronger blur, the contrast under an ideal disc vanishes and inverts (less so for
/// physical lenses, whose discs have soft rims), while the contrast under the Gaussian keeps
/// falling; such fringes are not measurable in either case.
pub(crate) struct Defocus {
    pupil: DVec3,
    /// The projector's optical axis in the rig's frame.
    axis: DVec3,
    /// Horizontal focal length fx times aperture over 4, in mm px.
    pub(crate) strength: f64,
    /// Ratio fy / fx of the focal lengths: blur along y over blur along x, each in projector pixels.
    pub(crate) aspect: f64,
    /// Inverse of the focused distance, in 1/mm.
    pub(crate) sharp: f64,
    /// Number of columns and rows of the pattern.
    size: [f64; 2],
    bell: Bell,
}

impl Defocus {
    pub(crate) fn new(projector: &Projector) -> Self {
        let view = projector.view();
        let (strength, sharp) = projector.focus.map_or((0.0, 0.0), |focus| {
            let strength = view.lens.focal_px.x * focus.aperture_mm / 4.0;
            (strength, 1.0 / focus.distance_mm)
        });
        Self {
            pupil: view.center(),
            axis: view.rig_from_view.rotation.z_axis,
            strength,
            aspect: projector.pixel_aspect,
            sharp,
            size: [view.lens.width_px, view.lens.height_px].map(f64::from),
            bell: Bell::new(),
        }
    }

    /// Dims points near the pattern's border: a blurred footprint receives no light from beyond the
    /// border. Light that blur carries out of the projector's field is neglected.
    pub(crate) fn dim_border(&self, shaded: &mut Shaded) {
        for lane in (0..LANES).filter(|&lane| shaded.reachable[lane]) {
            let across = self.sigma_px(DVec3::from_array(shaded.point.map(|axis| axis[lane])));
            for (axis, sigma) in [across, across * self.aspect].into_iter().enumerate() {
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

    /// Returns the standard deviation of the blur along x, in projector pixels, at a point in the
    /// rig's frame. The blur along y is `aspect` times as large.
    pub(crate) fn sigma_px(&self, point: DVec3) -> f64 {
        let z = self.axis.dot(point - self.pupil);
        self.strength * (self.sharp - 1.0 / z).abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_profile::{Focus, Profile};

    /// Compares the Gaussian with the fringe contrast at a point on the axis, integrated directly
    /// over the pupil: by similar triangles, a pupil point p is imaged at focal_px p (1/distance -
    /// 1/z).
    #[test]
    fn the_gaussian_stands_for_the_disc() {
        let mut profile = Profile::load("pmp-bench").unwrap();
        let mut worst: f64 = 0.0;
        for (aperture_mm, z, period) in [
            (5.0, 800.0, 16.0),
            (5.0, 1300.0, 16.0),
            (20.0, 900.0, 24.0),
            (20.0, 1100.0, 16.0),
            (25.0, 800.0, 64.0),
            (20.0, 800.0, 24.0),
        ] {
            profile.projector.focus = Some(Focus {
                distance_mm: 1000.0,
                aperture_mm,
            });
            let view = profile.projector.view();
            let forward = view.rig_from_view.rotation.z_axis;
            let sigma = Defocus::new(&profile.projector).sigma_px(view.center() + forward * z);
            let gauss = (-2.0 * (std::f64::consts::PI * sigma / period).powi(2)).exp();
            let n = 400;
            let (mut sum, mut area) = (0.0, 0.0);
            let place = |i: usize| ((i as f64 + 0.5) / n as f64 - 0.5) * aperture_mm;
            for x in (0..n).map(place) {
                for y in (0..n).map(place) {
                    if x.hypot(y) <= 0.5 * aperture_mm {
                        let px = view.lens.focal_px.x * x * (1.0 / 1000.0 - 1.0 / z);
                        sum += (std::f64::consts::TAU * px / period).cos();
                        area += 1.0;
                    }
                }
            }
            let disc: f64 = sum / area;
            println!("{aperture_mm} mm, {z} mm, {period} px: {gauss:.4} for {disc:.4}");
            assert!(disc > 0.6 && disc < 0.999, "{disc}");
            worst = worst.max((gauss - disc).abs());
        }
        assert!(worst < 0.03 && worst > 0.001, "{worst}");
    }
}
