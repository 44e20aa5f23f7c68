//! Exact intersection in f64 of a ray with a triangle that the traversal in f32 has found.

use super::hits::{Hits, SHADOW_END, Surface};
use glam::DVec3;

/// A triangle relative to a ray's origin.
pub(super) struct Triangle {
    id: u32,
    /// Corners relative to the ray's origin in millimetres.
    corners: [DVec3; 3],
    /// Unit normal, which may point to either side; `None` if the area is zero.
    normal: Option<DVec3>,
}

impl Triangle {
    /// Creates a triangle from its corners relative to a ray's origin.
    pub(super) fn new(id: u32, corners: [DVec3; 3]) -> Self {
        let [a, b, c] = corners;
        Self {
            id,
            corners,
            normal: (b - a).cross(c - a).try_normalize(),
        }
    }

    /// Returns the ray parameter of the intersection with the triangle's plane, clamped to the range
    /// of the parameters of its corners. Every true hit is in this range, while the plane of a
    /// triangle seen nearly edge-on is ill-conditioned. Directions have z = 1, so that parameters
    /// are depths.
    fn depth(&self, normal: DVec3, direction: DVec3) -> f64 {
        let [a, b, c] = self.corners;
        let (low, high) = (a.z.min(b.z).min(c.z), a.z.max(b.z).max(c.z));
        let t = normal.dot(a) / normal.dot(direction);
        // A NaN (the ray lies in the plane) becomes the depth of the nearest corner.
        if t >= low { t.min(high) } else { low }
    }

    /// Returns the unit normal, which may point to either side. A triangle whose area is zero in f64
    /// may have a nonzero area in f32 and then close a gap between its neighbours, so it counts as
    /// facing the ray.
    fn normal(&self, direction: DVec3) -> DVec3 {
        self.normal.unwrap_or_else(|| -direction.normalize())
    }

    /// Returns whether a ray passes through the triangle or its border, by the signs of three
    /// volumes. For an edge that two triangles share, both compute its volume from the same products
    /// with opposite signs.
    fn holds(&self, direction: DVec3) -> bool {
        let [a, b, c] = self.corners;
        let sides = [(a, b), (b, c), (c, a)].map(|(p, q)| direction.dot(p.cross(q)));
        sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0)
    }

    /// Records the intersection as the hit of a lane.
    pub(super) fn take(&self, direction: DVec3, lane: usize, hits: &mut Hits) {
        let normal = self.normal(direction);
        let t = self.depth(normal, direction);
        hits.set(lane, t, normal, direction, Surface(self.id));
    }

    /// Records an intersection that f32 found near the ray parameter `near`, for a ray of any
    /// direction.
    pub(super) fn take_near(&self, near: f64, direction: DVec3, lane: usize, hits: &mut Hits) {
        let normal = self.normal(direction);
        let t = normal.dot(self.corners[0]) / normal.dot(direction);
        // The plane of a triangle seen nearly edge-on is ill-conditioned.
        let t = if (t - near).abs() <= 1e-3 * near {
            t
        } else {
            near
        };
        hits.set(lane, t, normal, direction, Surface(self.id));
    }

    /// Acts like [`Self::take`] if this triangle is a better hit than `found`. A triangle that
    /// contains the ray is better than one that does not; if both or neither do, the nearer one is
    /// better.
    pub(super) fn take_from(&self, found: &Self, direction: DVec3, lane: usize, hits: &mut Hits) {
        let normal = self.normal(direction);
        let t = self.depth(normal, direction);
        let better = match (self.holds(direction), found.holds(direction)) {
            (true, false) => true,
            (false, true) => false,
            _ => t < hits.t[lane],
        };
        if better {
            hits.set(lane, t, normal, direction, Surface(self.id));
        }
    }

    /// Returns whether the triangle lies between the ray's origin and the point `way`, both
    /// excluded.
    pub(super) fn stands_before(&self, way: DVec3) -> bool {
        let normal = self.normal(way);
        let t = normal.dot(self.corners[0]) / normal.dot(way);
        t > 0.0 && t < SHADOW_END && self.holds(way)
    }
}
