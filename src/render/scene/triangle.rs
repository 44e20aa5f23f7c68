//! Exact f64 intersection of a ray with a triangle found by the f32 traversal.

use super::hits::{Hits, SHADOW_END, Surface};
use glam::DVec3;

/// A triangle relative to a ray's origin.
pub(super) struct Triangle {
    pub(super) id: u32,
    /// Corners relative to the ray's origin in millimetres.
    pub(super) corners: [DVec3; 3],
}

impl Triangle {
    /// Returns the ray parameter of the intersection with the triangle's plane, clamped to the
    /// range of its corners, which contains every true hit: near edge-on, the plane is
    /// ill-conditioned. Directions have z = 1, so that parameters are depths.
    fn depth(&self, normal: DVec3, direction: DVec3) -> f64 {
        let [a, b, c] = self.corners;
        let (low, high) = (a.z.min(b.z).min(c.z), a.z.max(b.z).max(c.z));
        let t = normal.dot(a) / normal.dot(direction);
        // NaN (all in the plane) becomes the nearest corner.
        if t >= low { t.min(high) } else { low }
    }

    /// Returns the unit normal, on either side. A triangle with zero area in f64 may have a nonzero
    /// area in f32 and then closes a gap between its neighbours: it counts as facing the ray.
    fn normal(&self, direction: DVec3) -> DVec3 {
        let [a, b, c] = self.corners;
        let across = (b - a).cross(c - a);
        across.try_normalize().unwrap_or(-direction.normalize())
    }

    /// Returns whether a ray passes through the triangle or its border, from the signs of three
    /// volumes. Two triangles compute the volume of a shared edge from the same products with
    /// opposite signs.
    fn holds(&self, direction: DVec3) -> bool {
        let [a, b, c] = self.corners;
        let sides = [(a, b), (b, c), (c, a)].map(|(p, q)| direction.dot(p.cross(q)));
        sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0)
    }

    /// Records the intersection as a lane's hit.
    pub(super) fn take(&self, direction: DVec3, lane: usize, hits: &mut Hits) {
        let normal = self.normal(direction);
        let t = self.depth(normal, direction);
        hits.set(lane, t, normal, direction, Surface(self.id));
    }

    /// Records an intersection that f32 found `near` a ray parameter, for a ray in any direction.
    pub(super) fn take_near(&self, near: f64, direction: DVec3, lane: usize, hits: &mut Hits) {
        let normal = self.normal(direction);
        let t = normal.dot(self.corners[0]) / normal.dot(direction);
        // Near edge-on, the plane is ill-conditioned.
        let t = if (t - near).abs() <= 1e-3 * near {
            t
        } else {
            near
        };
        hits.set(lane, t, normal, direction, Surface(self.id));
    }

    /// Acts like [`Self::take`] if this triangle is the better hit than `found`: a triangle that
    /// contains the ray precedes one that does not; otherwise the nearer one wins.
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

    /// Returns whether the triangle lies between the ray's origin and a point, both excluded.
    pub(super) fn stands_before(&self, way: DVec3) -> bool {
        let normal = self.normal(way);
        let t = normal.dot(self.corners[0]) / normal.dot(way);
        t > 0.0 && t < SHADOW_END && self.holds(way)
    }
}
