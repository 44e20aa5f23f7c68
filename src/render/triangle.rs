//! Exact f64 intersection of a ray with a triangle found by the f32 traversal.

use super::world::{Hits, SHADOW_END, Surface};
use glam::DVec3;

/// A triangle seen from a ray's origin.
pub(super) struct Triangle {
    pub(super) id: u32,
    /// Corners relative to the ray's origin in millimetres.
    pub(super) corners: [DVec3; 3],
}

impl Triangle {
    /// Ray parameter at which the ray meets the triangle's plane, kept within the parameters of its
    /// corners, where a ray that hits it must end: edge-on the plane says nothing. Directions have
    /// z = 1, so that parameters are depths.
    fn depth(&self, normal: DVec3, direction: DVec3) -> f64 {
        let [a, b, c] = self.corners;
        let (low, high) = (a.z.min(b.z).min(c.z), a.z.max(b.z).max(c.z));
        let t = normal.dot(a) / normal.dot(direction);
        // NaN, where all lies in the plane, is taken for the nearest.
        if t >= low { t.min(high) } else { low }
    }

    /// Unit normal, either way. A triangle without area in f64 may have one in f32, and then closes
    /// a gap between its neighbours: it counts as facing the ray.
    fn normal(&self, direction: DVec3) -> DVec3 {
        let [a, b, c] = self.corners;
        let across = (b - a).cross(c - a);
        across.try_normalize().unwrap_or(-direction.normalize())
    }

    /// Whether a ray passes through the triangle or its border: the signs of three volumes. Two
    /// triangles with a common edge compute its volume from the same products with opposite signs.
    fn holds(&self, direction: DVec3) -> bool {
        let [a, b, c] = self.corners;
        let sides = [(a, b), (b, c), (c, a)].map(|(p, q)| direction.dot(p.cross(q)));
        sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0)
    }

    /// Takes the meeting as a lane's hit.
    pub(super) fn take(&self, direction: DVec3, lane: usize, hits: &mut Hits) {
        let normal = self.normal(direction);
        let t = self.depth(normal, direction);
        hits.set(lane, t, normal, direction, Surface(self.id));
    }

    /// Takes an intersection that f32 has found `near` a ray parameter, for a ray in any direction.
    pub(super) fn take_near(&self, near: f64, direction: DVec3, lane: usize, hits: &mut Hits) {
        let normal = self.normal(direction);
        let t = normal.dot(self.corners[0]) / normal.dot(direction);
        // Edge-on the plane says nothing.
        let t = if (t - near).abs() <= 1e-3 * near {
            t
        } else {
            near
        };
        hits.set(lane, t, normal, direction, Surface(self.id));
    }

    /// As [`Self::take`] if the ray meets this triangle rather than the one found before: one that holds it
    /// before one that does not, then the nearer.
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

    /// Whether the triangle stands between the ray's origin and a point, both excluded.
    pub(super) fn stands_before(&self, way: DVec3) -> bool {
        let normal = self.normal(way);
        let t = normal.dot(self.corners[0]) / normal.dot(way);
        t > 0.0 && t < SHADOW_END && self.holds(way)
    }
}
