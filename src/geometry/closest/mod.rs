//! Closest point on a mesh and line-of-sight tests against a mesh, in f64 over a bounding volume
//! hierarchy.
//!
//! Boxes are f32, rounded outwards, so they strictly bound the f64 corners; every distance is computed
//! in f64. Ground truth is measured with this module, so this module shares no code with the renderer.

#[cfg(test)]
mod tests;
mod triangle;

use super::Mesh;
use glam::{DVec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::{Boundable, BvhBuildParams};
use rayon::prelude::*;
use triangle::{closest_on_triangle, crossing};

/// A mesh and its search tree.
pub struct MeshTree {
    nodes: Vec<Node>,
    /// Triangle corners in leaf order.
    corners: Vec<[DVec3; 3]>,
    /// Mesh index of each triangle in `corners`.
    triangles: Vec<u32>,
}

/// The point of a mesh closest to a query point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closest {
    /// The nearest point of the mesh, in millimetres.
    pub point: DVec3,
    /// Distance between the query point and `point`, in millimetres.
    pub distance_mm: f64,
    /// Mesh index of a triangle that contains the point.
    pub triangle: u32,
    /// Unit normal of that triangle, by its winding; zero for a degenerate triangle.
    pub normal: DVec3,
}

struct Bounded(Aabb);

impl Boundable for Bounded {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

impl MeshTree {
    /// Builds the tree over a mesh that passed [`Mesh::checked`].
    pub fn new(mesh: &Mesh) -> Self {
        let boxes: Vec<Bounded> = (0..mesh.triangles.len())
            .map(|i| {
                let [a, b, c] = mesh.corners(i);
                Bounded(Aabb::new(
                    outwards(a.min(b).min(c), f64::lt, f32::next_down),
                    outwards(a.max(b).max(c), f64::gt, f32::next_up),
                ))
            })
            .collect();
        let bvh = obvhs::bvh2::builder::build_bvh2(
            &boxes,
            BvhBuildParams::fast_build(),
            &mut std::time::Duration::default(),
        );
        let nodes = bvh
            .nodes
            .iter()
            .map(|n| Node {
                lo: n.aabb.min.to_array(),
                hi: n.aabb.max.to_array(),
                first: n.first_index,
                count: n.prim_count,
            })
            .collect();
        Self {
            nodes,
            corners: bvh
                .primitive_indices
                .iter()
                .map(|&i| mesh.corners(i as usize))
                .collect(),
            triangles: bvh.primitive_indices,
        }
    }

    /// Returns the point of the mesh closest to `p`, both in the mesh's frame; `None` for a mesh
    /// without triangles or if `p` is not finite.
    pub fn closest(&self, p: DVec3) -> Option<Closest> {
        self.search(p, &mut Vec::with_capacity(64))
    }

    /// Runs [`Self::closest`] for many points in parallel.
    pub fn closest_batch(&self, points: &[DVec3]) -> Vec<Option<Closest>> {
        points
            .par_iter()
            .with_min_len(256)
            .map_init(|| Vec::with_capacity(64), |stack, &p| self.search(p, stack))
            .collect()
    }

    fn search(&self, p: DVec3, stack: &mut Vec<(f64, u32)>) -> Option<Closest> {
        if self.nodes.is_empty() || !p.is_finite() {
            return None;
        }
        let mut best = (f64::INFINITY, DVec3::ZERO, 0_usize);
        stack.clear();
        stack.push((self.nodes[0].distance_squared(p), 0));
        while let Some((distance, index)) = stack.pop() {
            if distance >= best.0 {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.count > 0 {
                for i in node.first as usize..(node.first + node.count) as usize {
                    let q = closest_on_triangle(p, &self.corners[i]);
                    let d = (q - p).length_squared();
                    if d < best.0 {
                        best = (d, q, i);
                    }
                }
                continue;
            }
            let [a, b] = [node.first, node.first + 1]
                .map(|i| (self.nodes[i as usize].distance_squared(p), i));
            // Visit the nearer child first.
            let (near, far) = if a.0 <= b.0 { (a, b) } else { (b, a) };
            if far.0 < best.0 {
                stack.push(far);
            }
            if near.0 < best.0 {
                stack.push(near);
            }
        }
        let (d, point, at) = best;
        d.is_finite().then(|| {
            let [a, b, c] = self.corners[at];
            Closest {
                point,
                distance_mm: d.sqrt(),
                triangle: self.triangles[at],
                normal: (b - a).cross(c - a).normalize_or_zero(),
            }
        })
    }
}

/// A node of the hierarchy.
struct Node {
    lo: [f32; 3],
    hi: [f32; 3],
    /// Index of the first of two children, or of the leaf's first triangle.
    first: u32,
    /// Number of triangles of a leaf; 0 for an inner node.
    count: u32,
}

impl Node {
    /// Squared distance from a point to the box; 0 inside.
    #[inline]
    fn distance_squared(&self, p: DVec3) -> f64 {
        let (lo, hi) = (widened(self.lo), widened(self.hi));
        (lo - p).max(p - hi).max(DVec3::ZERO).length_squared()
    }

    /// Returns whether a ray passes through the box between the distances `near` and `far`;
    /// `inverse` is the componentwise inverse of its direction.
    #[inline]
    fn meets(&self, from: DVec3, inverse: DVec3, near: f64, far: f64) -> bool {
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
fn outwards(v: DVec3, beyond: fn(&f64, &f64) -> bool, step: fn(f32) -> f32) -> Vec3A {
    Vec3A::from_array(v.to_array().map(|x| {
        let rounded = x as f32;
        if beyond(&x, &f64::from(rounded)) {
            step(rounded)
        } else {
            rounded
        }
    }))
}

impl MeshTree {
    /// Returns whether the mesh crosses the segment from `from` to `to`. The last `margin_mm` at both
    /// ends are ignored, so that the surface on which an end lies does not count.
    pub fn blocks(&self, from: DVec3, to: DVec3, margin_mm: f64) -> bool {
        let length = (to - from).length();
        // A segment of zero or NaN length crosses nothing.
        if self.nodes.is_empty() || length.is_nan() || length <= 2.0 * margin_mm {
            return false;
        }
        let direction = (to - from) / length;
        // A zero component would give 0 x infinity = NaN for a box face that the origin touches.
        let inverse = DVec3::from_array(direction.to_array().map(|d| {
            if d.abs() > 1e-300 {
                1.0 / d
            } else {
                1e300_f64.copysign(d)
            }
        }));
        let (near, far) = (margin_mm, length - margin_mm);
        let mut stack = Vec::with_capacity(64);
        stack.push(0_u32);
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index as usize];
            if !node.meets(from, inverse, near, far) {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.first + 1, node.first]);
                continue;
            }
            let leaf = node.first as usize..(node.first + node.count) as usize;
            if self.corners[leaf]
                .iter()
                .any(|t| crossing(from, direction, t).is_some_and(|t| t > near && t < far))
            {
                return true;
            }
        }
        false
    }
}
