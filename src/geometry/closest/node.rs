//! Bounding boxes in f32 around f64 corners, rounded outwards.

use glam::{DVec3, Vec3A};

/// A node of the hierarchy.
pub(super) struct Node {
    pub(super) lo: [f32; 3],
    pub(super) hi: [f32; 3],
    /// Index of the first of two children, or of the leaf's first triangle.
    pub(super) first: u32,
    /// Number of triangles of a leaf; 0 for an inner node.
    pub(super) count: u32,
}

impl Node {
    /// Squared distance from a point to the box; 0 inside.
    #[inline]
    pub(super) fn distance_squared(&self, p: DVec3) -> f64 {
        let (lo, hi) = (widened(self.lo), widened(self.hi));
        (lo - p).max(p - hi).max(DVec3::ZERO).length_squared()
    }

    /// Returns whether a ray passes through the box between the distances `near` and `far`;
    /// `inverse` is the componentwise inverse of its direction.
    #[inline]
    pub(super) fn meets(&self, from: DVec3, inverse: DVec3, near: f64, far: f64) -> bool {
        let a = (widened(self.lo) - from) * inverse;
        let b = (widened(self.hi) - from) * inverse;
        // A relative slack covers the rounding of the products.
        let enter = a.min(b).max_element().max(near);
        let leave = a.max(b).min_element().min(far);
        enter <= leave + 1e-12 * leave.abs()
    }
}

#[inline]
fn widened(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

/// Rounds each coordinate to the nearest f32 at or beyond it, in the direction of `step`.
pub(super) fn outwards(v: DVec3, beyond: fn(&f64, &f64) -> bool, step: fn(f32) -> f32) -> Vec3A {
    Vec3A::from_array(v.to_array().map(|x| {
        let rounded = x as f32;
        if beyond(&x, &f64::from(rounded)) {
            step(rounded)
        } else {
            rounded
        }
    }))
}
