//! Mapping of a texture of a given size onto a shape, in millimetres of the shape's frame:
//!
//! - a sphere: longitude (0 towards -z, growing towards x) and latitude (growing towards y), each
//!   times the radius: true to size along the equator and all meridians;
//! - a cylinder: the angle about y times the radius, and y; its caps along x and z;
//! - any other shape: x and y, as if projected along z.
//!
//! The texture's centre is at the origin of these coordinates. Its columns run along the first
//! coordinate; its rows run along the second, downwards.

use glam::{DVec2, DVec3};
use phasmid_profile::Shape;

/// Texture coordinates and their spatial gradients.
pub(crate) struct Laid {
    pub(crate) at: DVec2,
    pub(crate) gradient: [DVec3; 2],
}

#[derive(Debug, Clone, Copy)]
pub(crate) enum Lay {
    Along,
    Sphere,
    Cylinder,
}

impl Lay {
    pub(super) fn new(shape: &Shape) -> Self {
        match shape {
            Shape::Sphere { .. } => Self::Sphere,
            Shape::Cylinder { .. } => Self::Cylinder,
            _ => Self::Along,
        }
    }

    /// Returns the texture coordinates of a point with a unit normal, both in the shape's own frame.
    pub(crate) fn at(self, p: DVec3, normal: DVec3) -> Laid {
        let flat = |a: DVec3, b: DVec3| Laid {
            at: DVec2::new(a.dot(p), b.dot(p)),
            gradient: [a, b],
        };
        // The angle about y and its gradient, both times the radius, which makes the angle a length.
        let around = |radius: f64| {
            let square = (p.x * p.x + p.z * p.z).max(1e-18 * radius * radius);
            let angle = p.x.atan2(-p.z);
            let gradient = DVec3::new(-p.z, 0.0, p.x) * (radius / square);
            (angle * radius, gradient)
        };
        match self {
            Self::Along => flat(DVec3::X, DVec3::Y),
            Self::Cylinder if normal.y.abs() > 0.5 => flat(DVec3::X, DVec3::Z),
            Self::Cylinder => {
                let (u, across) = around(p.x.hypot(p.z));
                Laid {
                    at: DVec2::new(u, p.y),
                    gradient: [across, DVec3::Y],
                }
            }
            Self::Sphere => {
                let radius = p.length();
                let (u, across) = around(radius);
                let ring = p.x.hypot(p.z).max(1e-9 * radius);
                let latitude = p.y.atan2(ring);
                let down = DVec3::new(-p.x * p.y / ring, ring, -p.z * p.y / ring) / radius;
                Laid {
                    at: DVec2::new(u, latitude * radius),
                    gradient: [across, down],
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradients_are_those_of_the_coordinates() {
        let p = DVec3::new(12.0, -7.0, -31.0);
        for (lay, normal) in [
            (Lay::Along, DVec3::NEG_Z),
            (Lay::Cylinder, DVec3::new(12.0, 0.0, -31.0).normalize()),
            (Lay::Cylinder, DVec3::Y),
            (Lay::Sphere, p.normalize()),
        ] {
            let here = lay.at(p, normal);
            // Step along the surface only, since off the surface the radius changes as well.
            for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                let step = (axis - normal * normal.dot(axis)) * 1e-5;
                let there = lay.at(p + step, normal);
                for i in 0..2 {
                    let expected = here.gradient[i].dot(step);
                    let found = there.at[i] - here.at[i];
                    assert!((found - expected).abs() < 1e-9, "{lay:?} {i} {axis}");
                }
            }
        }
    }
}
