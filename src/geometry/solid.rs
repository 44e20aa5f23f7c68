//! Analytic solids, intersected in closed form, in f64, in their own frame.
//!
//! Plane and frustum lie on z = 0; the frustum extends towards -z. All solids are convex: seen from
//! outside, a surface shades itself only by facing away.

use glam::{DVec2, DVec3};

/// A shape in its own frame, in millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Solid {
    /// The plane z = 0, within `half` of the origin along x and y.
    Plane {
        /// Half sides; infinite for an unbounded plane.
        half: DVec2,
    },
    /// A sphere centred on the origin.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// A closed cylinder centred on the origin, along y.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Half the length.
        half_length: f64,
    },
    /// A square frustum, as the half-spaces n . p <= offset made by [`Solid::frustum`].
    Frustum {
        /// Outward unit normal and offset of the top, the base and the four sides.
        faces: [(DVec3, f64); 6],
    },
}

/// Intersection of a ray with a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolidHit {
    /// Ray parameter.
    pub t: f64,
    /// Outward unit normal in the shape's frame.
    pub normal: DVec3,
    /// Index of the smooth part of the surface that was hit.
    pub facet: u32,
}

impl Solid {
    /// Creates a square frustum with its base at z = 0 and its top at z = -height.
    pub fn frustum(base: f64, top: f64, height: f64) -> Self {
        // The sides rise by `height` while leaning in by half of base - top.
        let lean = (base - top) / 2.0;
        let length = height.hypot(lean);
        let (out, up) = (height / length, -lean / length);
        let offset = base / 2.0 * out;
        Self::Frustum {
            faces: [
                (DVec3::NEG_Z, height),
                (DVec3::Z, 0.0),
                (DVec3::new(out, 0.0, up), offset),
                (DVec3::new(-out, 0.0, up), offset),
                (DVec3::new(0.0, out, up), offset),
                (DVec3::new(0.0, -out, up), offset),
            ],
        }
    }

    /// Returns whether a point lies inside the solid; always false for a plane.
    pub fn contains(&self, p: DVec3) -> bool {
        match *self {
            Self::Plane { .. } => false,
            Self::Sphere { radius } => p.length() < radius,
            Self::Cylinder {
                radius,
                half_length,
            } => p.x.hypot(p.z) < radius && p.y.abs() < half_length,
            Self::Frustum { ref faces } => faces.iter().all(|(n, offset)| n.dot(p) < *offset),
        }
    }

    /// Returns the first intersection of a ray with the surface at a parameter above `t_min`.
    pub fn intersect(&self, origin: DVec3, direction: DVec3, t_min: f64) -> Option<SolidHit> {
        match *self {
            Self::Plane { half } => plane(half, origin, direction, t_min),
            Self::Sphere { radius } => {
                let t = first_root(origin, direction, radius, t_min)?;
                Some(SolidHit {
                    t,
                    normal: (origin + direction * t) / radius,
                    facet: 0,
                })
            }
            Self::Cylinder {
                radius,
                half_length,
            } => cylinder(radius, half_length, origin, direction, t_min),
            Self::Frustum { ref faces } => convex(faces, origin, direction, t_min),
        }
    }
}

fn plane(half: DVec2, origin: DVec3, direction: DVec3, t_min: f64) -> Option<SolidHit> {
    let t = -origin.z / direction.z;
    let p = origin + direction * t;
    let inside = p.x.abs() <= half.x && p.y.abs() <= half.y;
    (t > t_min && t.is_finite() && inside).then_some(SolidHit {
        t,
        normal: DVec3::NEG_Z,
        facet: 0,
    })
}

/// Returns the smallest root above `t_min` of |o + t d|^2 = r^2 without cancellation: the
/// discriminant is computed from the ray's point of closest approach (Haines et al., "Precision
/// Improvements for Ray/Sphere Intersection", Ray Tracing Gems, 2019).
fn first_root(o: DVec3, d: DVec3, radius: f64, t_min: f64) -> Option<f64> {
    let a = d.length_squared();
    let b = -o.dot(d);
    let approach = o + d * (b / a);
    let discriminant = a * (radius * radius - approach.length_squared());
    if !(a > 0.0 && discriminant >= 0.0) {
        return None;
    }
    let c = o.length_squared() - radius * radius;
    let q = b + discriminant.sqrt().copysign(b);
    let (t0, t1) = (c / q, q / a);
    [t0.min(t1), t0.max(t1)].into_iter().find(|&t| t > t_min)
}

fn cylinder(radius: f64, half_length: f64, o: DVec3, d: DVec3, t_min: f64) -> Option<SolidHit> {
    let flat = |v: DVec3| DVec3::new(v.x, 0.0, v.z);
    // Check both roots: the near intersection may lie beyond the end of the cylinder.
    let side = |t_min: f64| {
        let t = first_root(flat(o), flat(d), radius, t_min)?;
        Some(SolidHit {
            t,
            normal: flat(o + d * t) / radius,
            facet: 0,
        })
    };
    let on_side = |hit: &SolidHit| (o.y + d.y * hit.t).abs() <= half_length;
    let near = side(t_min);
    let side_hit = near
        .filter(on_side)
        .or_else(|| near.and_then(|hit| side(hit.t)).filter(on_side));
    let caps = [(1.0, 1), (-1.0, 2)]
        .into_iter()
        .filter_map(|(sign, facet)| {
            let t = (sign * half_length - o.y) / d.y;
            let p = flat(o + d * t);
            (t > t_min && t.is_finite() && p.length() <= radius).then_some(SolidHit {
                t,
                normal: DVec3::new(0.0, sign, 0.0),
                facet,
            })
        });
    caps.chain(side_hit).min_by(|a, b| a.t.total_cmp(&b.t))
}

/// Intersects a convex solid, given as half-spaces n . p <= offset, by clipping the ray (Cyrus and
/// Beck 1978).
fn convex(faces: &[(DVec3, f64)], o: DVec3, d: DVec3, t_min: f64) -> Option<SolidHit> {
    let mut enter = (f64::NEG_INFINITY, 0);
    let mut leave = (f64::INFINITY, 0);
    for (i, (normal, offset)) in faces.iter().enumerate() {
        let (speed, gap) = (normal.dot(d), offset - normal.dot(o));
        if speed == 0.0 {
            if gap < 0.0 {
                return None;
            }
            continue;
        }
        let t = gap / speed;
        if speed < 0.0 {
            if t > enter.0 {
                enter = (t, i);
            }
        } else if t < leave.0 {
            leave = (t, i);
        }
    }
    if enter.0 > leave.0 {
        return None;
    }
    [enter, leave]
        .into_iter()
        .find(|(t, _)| *t > t_min && t.is_finite())
        .map(|(t, i)| SolidHit {
            t,
            normal: faces[i].0,
            facet: i as u32,
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sphere_from_far_keeps_its_digits() {
        let sphere = Solid::Sphere { radius: 1.0 };
        let hit = sphere
            .intersect(DVec3::new(0.5, 0.0, -1e7), DVec3::Z, 0.0)
            .unwrap();
        assert!((hit.t - (1e7 - 0.75f64.sqrt())).abs() < 2e-9);
        assert!(
            sphere
                .intersect(DVec3::new(1.1, 0.0, -9.0), DVec3::Z, 0.0)
                .is_none()
        );
        // A ray that starts inside hits the far wall.
        let inside = sphere.intersect(DVec3::ZERO, DVec3::X, 0.0).unwrap();
        assert!((inside.t - 1.0).abs() < 1e-15);
    }

    #[test]
    fn rays_hit_side_or_cap_of_cylinder_or_miss() {
        let c = Solid::Cylinder {
            radius: 2.0,
            half_length: 5.0,
        };
        let side = c
            .intersect(DVec3::new(0.0, 1.0, -9.0), DVec3::Z, 0.0)
            .unwrap();
        assert_eq!((side.t, side.facet), (7.0, 0));
        let cap = c
            .intersect(DVec3::new(0.5, 9.0, 0.0), DVec3::NEG_Y, 0.0)
            .unwrap();
        assert_eq!((cap.t, cap.facet), (4.0, 1));
        // The ray enters through the cap, although it meets the infinite side before the cap.
        let slant = DVec3::new(0.0, -1.0, 0.5);
        assert_eq!(
            c.intersect(DVec3::new(0.0, 9.0, -3.0), slant, 0.0)
                .unwrap()
                .facet,
            1
        );
        assert!(
            c.intersect(DVec3::new(0.0, 6.0, -9.0), DVec3::Z, 0.0)
                .is_none()
        );
    }

    #[test]
    fn rays_hit_top_or_sides_of_frustum_or_miss() {
        let f = Solid::frustum(200.0, 100.0, 80.0);
        let top = f
            .intersect(DVec3::new(10.0, -20.0, -1000.0), DVec3::Z, 0.0)
            .unwrap();
        assert!((top.t - 920.0).abs() < 1e-12 && top.facet == 0);
        // Half-way between the edges of top and base, the surface is at half the height.
        let side = f
            .intersect(DVec3::new(75.0, 0.0, -1000.0), DVec3::Z, 0.0)
            .unwrap();
        assert!((side.t - 960.0).abs() < 1e-12 && side.facet == 2);
        assert!((side.normal - DVec3::new(80.0, 0.0, -50.0) / 8900f64.sqrt()).length() < 1e-15);
        assert!(
            f.intersect(DVec3::new(101.0, 0.0, -1000.0), DVec3::Z, 0.0)
                .is_none()
        );
    }

    #[test]
    fn plane_is_met_within_its_sides() {
        let p = Solid::Plane {
            half: DVec2::new(3.0, f64::INFINITY),
        };
        assert!(
            p.intersect(DVec3::new(2.9, 1e6, -1.0), DVec3::Z, 0.0)
                .is_some()
        );
        assert!(
            p.intersect(DVec3::new(3.1, 0.0, -1.0), DVec3::Z, 0.0)
                .is_none()
        );
        assert!(
            p.intersect(DVec3::new(0.0, 0.0, -1.0), DVec3::X, 0.0)
                .is_none()
        );
    }
}
