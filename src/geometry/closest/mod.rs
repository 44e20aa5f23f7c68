//! Closest point on a mesh and line-of-sight tests against a mesh, in f64 over a bounding volume
//! hierarchy.
//!
//! Boxes are f32, rounded outwards, so they strictly bound the f64 corners; every distance is
//! computed in f64. Ground truth is measured with this module, so it shares no code with the
//! renderer.

mod node;
mod segment;
#[cfg(test)]
mod tests;
mod triangle;

use super::Mesh;
use glam::DVec3;
use node::{Node, outwards};
use obvhs::aabb::Aabb;
use obvhs::{Boundable, BvhBuildParams};
use rayon::prelude::*;
use triangle::closest_on_triangle;

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
    /// Distance to it in millimetres.
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
