//! One disc of a surfel cloud, and the estimation of its normal.

use super::{Foot, widened};
use glam::DVec3;
use nalgebra::Matrix3;

/// A flat disc of surface around a point.
#[derive(Clone, Copy)]
pub(super) struct Disc {
    pub(super) centre: DVec3,
    pub(super) normal: DVec3,
    pub(super) radius: f64,
}

impl Disc {
    /// Returns the foot of the perpendicular if it lies on the disc.
    #[inline]
    pub(super) fn below(&self, p: DVec3) -> Option<Foot> {
        let height = (p - self.centre).dot(self.normal);
        let point = p - self.normal * height;
        let over = (point - self.centre).length_squared() <= self.radius * self.radius;
        (over && self.radius > 0.0).then_some(Foot {
            point,
            distance_mm: height.abs(),
            normal: self.normal,
        })
    }

    /// Returns the closest point of the disc.
    #[inline]
    pub(super) fn closest(&self, p: DVec3) -> Foot {
        let offset = p - self.centre;
        let in_plane = offset - self.normal * offset.dot(self.normal);
        let point = self.centre + in_plane.clamp_length_max(self.radius);
        Foot {
            point,
            distance_mm: (p - point).length(),
            normal: self.normal,
        }
    }
}

/// Returns the unit direction in which points vary least; `None` if they do not span a plane.
pub(super) fn least_spread(points: impl Iterator<Item = [f32; 3]> + Clone) -> Option<DVec3> {
    let count = points.clone().count() as f64;
    let mean = points.clone().map(widened).sum::<DVec3>() / count;
    let mut spread = Matrix3::zeros();
    for p in points {
        let d = widened(p) - mean;
        let d = nalgebra::Vector3::new(d.x, d.y, d.z);
        spread += d * d.transpose();
    }
    let eigen = spread.symmetric_eigen();
    let values = eigen.eigenvalues;
    let (least, most) = (values.imin(), values.imax());
    if least == most {
        return None;
    }
    let middle = values[3 - least - most];
    // Collinear or coincident points span no plane.
    if middle.is_nan() || middle <= 1e-6 * values[most] {
        return None;
    }
    let v = eigen.eigenvectors.column(least);
    DVec3::new(v[0], v[1], v[2]).try_normalize()
}
