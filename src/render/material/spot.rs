//! A spot on a surface seen by a pixel, at which materials are evaluated, and barycentric weights.

use glam::DVec3;
use phasmid_geometry::Pose;

/// A surface point with its footprint, in the rig's frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spot {
    /// Corners of the triangle on which the point lies; `None` on a solid.
    pub(crate) corners: Option<[DVec3; 3]>,
    pub(crate) point: DVec3,
    pub(crate) normal: DVec3,
    /// Sides of the footprint on the tangent plane.
    pub(crate) sides: [DVec3; 2],
}

impl Spot {
    /// Returns the spot transformed by a rigid motion.
    pub(crate) fn moved(&self, pose: &Pose) -> Self {
        Self {
            corners: self.corners.map(|corners| corners.map(|p| pose.point(p))),
            point: pose.point(self.point),
            normal: pose.direction(self.normal),
            sides: self.sides.map(|side| pose.direction(side)),
        }
    }

    /// Returns the corresponding spot on the same triangle after its corners have moved to
    /// `corners`.
    pub(crate) fn on(&self, corners: [DVec3; 3]) -> Self {
        let Some(now) = self.corners else {
            return *self;
        };
        let blend = |w: [f64; 3]| (0..3).map(|i| corners[i] * w[i]).sum::<DVec3>();
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        Self {
            corners: Some(corners),
            point: blend(barycentric(now, self.point)),
            normal: normal.try_normalize().unwrap_or(self.normal),
            sides: self.sides.map(|side| blend(shares(now, side))),
        }
    }
}

/// Returns the weights of a triangle's corners at a point of the triangle's plane; none is negative.
pub(crate) fn barycentric(corners: [DVec3; 3], point: DVec3) -> [f64; 3] {
    let raw = shares(corners, point - corners[0]);
    let raw = [1.0 + raw[0], raw[1], raw[2]].map(|w| w.max(0.0));
    let sum: f64 = raw.iter().sum();
    if sum > 0.0 {
        raw.map(|w| w / sum)
    } else {
        [1.0, 0.0, 0.0]
    }
}

/// Returns the change of the barycentric weights over a step in the triangle's plane; NaN if the
/// triangle is degenerate.
pub(super) fn shares([a, b, c]: [DVec3; 3], step: DVec3) -> [f64; 3] {
    let (e1, e2) = (b - a, c - a);
    let normal = e1.cross(e2);
    let area2 = normal.length_squared();
    let second = step.cross(e2).dot(normal) / area2;
    let third = e1.cross(step).dot(normal) / area2;
    [-second - third, second, third]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_takes_its_spots_along() {
        let now = [DVec3::ZERO, DVec3::X * 2.0, DVec3::Y * 2.0];
        let spot = Spot {
            corners: Some(now),
            point: DVec3::new(0.5, 1.0, 0.0),
            normal: DVec3::Z,
            sides: [DVec3::X * 0.1, DVec3::Y * 0.2],
        };
        let pose = Pose::from_xyz_deg(DVec3::new(3.0, 4.0, -5.0), DVec3::new(20.0, 50.0, -70.0));
        let (moved, on) = (spot.moved(&pose), spot.on(now.map(|p| pose.point(p))));
        assert!((moved.point - on.point).length() < 1e-14);
        assert!((moved.normal - on.normal).length() < 1e-14);
        assert!((moved.sides[1] - on.sides[1]).length() < 1e-14);
        // If the triangle is stretched twofold along x, so is the footprint.
        let on = spot.on(now.map(|p| p * DVec3::new(2.0, 1.0, 1.0)));
        assert!((on.point - DVec3::new(1.0, 1.0, 0.0)).length() < 1e-14);
        assert!((on.sides[0] - DVec3::X * 0.2).length() < 1e-14);
    }
}
