//! Occlusion test for sixteen parallel rays with separate origins, as for light from far away.
//!
//! The test is that of [`super::triangle`] (Woop, Benthin, Wald 2013) with the roles swapped: one shear
//! for all lanes, and a sheared origin per lane. Two triangles that share an edge still compute the
//! function of this edge from the same numbers, so no ray passes between them.

use super::bvh::{Bvh, Corners};
use super::node::Node;
use super::packet::{LANES, Lanes, Scratch, max, min};
use glam::Vec3;
use phasmid_core::simd::widest;

/// Widens the far plane, as for packets (Ize 2013).
const FAR: f32 = 1.0 + 4.0 * f32::EPSILON;
/// Minimum magnitude of a direction component.
const SMALLEST: f32 = 1e-30;

/// Parallel rays.
#[derive(Debug, Clone)]
pub struct Parallel {
    /// Reference point for the sheared origins, chosen to keep their precision.
    reference: Vec3,
    origin: [Lanes; 3],
    inverse: Vec3,
    /// Permutation that puts the direction's largest component last.
    k: [usize; 3],
    shear: Vec3,
    /// Origins relative to the reference, permuted and sheared.
    sheared: [Lanes; 3],
    /// Ray parameter from which hits count, for each lane; nearer hits are ignored.
    start: Lanes,
    /// Triangle that each lane ignores, because the lane's ray starts on it.
    own: [u32; LANES],
    /// Lanes in use and not blocked so far.
    open: [bool; LANES],
}

impl Parallel {
    /// Creates rays towards `direction`, a unit vector. Each used lane has its origin, the ray
    /// parameter from which hits count, and the triangle to ignore.
    pub fn new(direction: Vec3, lanes: &[Option<(Vec3, f32, u32)>; LANES]) -> Self {
        let kz = (0..3)
            .max_by(|&a, &b| direction[a].abs().total_cmp(&direction[b].abs()))
            .unwrap_or(2);
        let k = [(kz + 1) % 3, (kz + 2) % 3, kz];
        let dz = direction[kz];
        let shear = Vec3::new(direction[k[0]] / dz, direction[k[1]] / dz, 1.0 / dz);
        let reference = lanes.iter().flatten().next().map_or(Vec3::ZERO, |l| l.0);
        let mut rays = Self {
            reference,
            origin: [[0.0; LANES]; 3],
            inverse: Vec3::from_array(direction.to_array().map(|d| {
                if d.abs() > SMALLEST {
                    1.0 / d
                } else {
                    (1.0 / SMALLEST).copysign(d)
                }
            })),
            k,
            shear,
            sheared: [[0.0; LANES]; 3],
            start: [0.0; LANES],
            own: [u32::MAX; LANES],
            open: [false; LANES],
        };
        for (lane, ray) in lanes.iter().enumerate() {
            let Some((origin, start, own)) = *ray else {
                continue;
            };
            let o = origin - reference;
            let o = Vec3::new(o[k[0]], o[k[1]], o[k[2]]);
            rays.sheared[0][lane] = o.x - shear.x * o.z;
            rays.sheared[1][lane] = o.y - shear.y * o.z;
            rays.sheared[2][lane] = o.z;
            for axis in 0..3 {
                rays.origin[axis][lane] = origin[axis];
            }
            (rays.start[lane], rays.own[lane], rays.open[lane]) = (start, own, true);
        }
        rays
    }
}

impl Bvh {
    /// Returns for each lane whether it is in use and its ray is blocked. No hit is left undecided.
    pub fn blocked_along(&self, mut rays: Parallel, scratch: &mut Scratch) -> [bool; LANES] {
        let asked = rays.open;
        if !self.nodes.is_empty() {
            walk(self, &mut rays, scratch);
        }
        std::array::from_fn(|lane| asked[lane] && !rays.open[lane])
    }
}

widest! {
    fn walk(bvh: &Bvh, rays: &mut Parallel, scratch: &mut Scratch) => walk_body
}

#[inline(always)]
fn walk_body(bvh: &Bvh, rays: &mut Parallel, scratch: &mut Scratch) {
    let stack = &mut scratch.stack;
    stack.clear();
    stack.push((0, 0.0));
    while let Some((index, _)) = stack.pop() {
        let node = &bvh.nodes[index as usize];
        if !meets(node, rays) {
            continue;
        }
        let first = node.first;
        if node.count == 0 {
            stack.extend([(first, 0.0), (first + 1, 0.0)]);
            continue;
        }
        for corners in &bvh.triangles[first as usize..(first + node.count) as usize] {
            intersect(rays, corners);
        }
        if !rays.open.contains(&true) {
            return;
        }
    }
}

/// Returns whether an open lane hits the box.
#[inline(always)]
fn meets(node: &Node, rays: &Parallel) -> bool {
    let mut any = [false; LANES];
    for lane in 0..LANES {
        let (mut near, mut far) = (0.0f32, f32::INFINITY);
        for axis in 0..3 {
            let (origin, inverse) = (rays.origin[axis][lane], rays.inverse[axis]);
            let t0 = (node.min[axis] - origin) * inverse;
            let t1 = (node.max[axis] - origin) * inverse;
            near = max(near, min(t0, t1));
            far = min(far, max(t0, t1));
        }
        any[lane] = (near <= far * FAR) & rays.open[lane];
    }
    any.contains(&true)
}

/// Returns a vertex relative to the reference point, permuted and sheared.
#[inline(always)]
fn sheared(rays: &Parallel, vertex: Vec3) -> Vec3 {
    let [kx, ky, kz] = rays.k;
    let v = (vertex - rays.reference).to_array();
    Vec3::new(
        v[kx] - rays.shear.x * v[kz],
        v[ky] - rays.shear.y * v[kz],
        v[kz],
    )
}

#[inline(always)]
fn intersect(rays: &mut Parallel, corners: &Corners) {
    let shear = rays.shear;
    // The closure of `map` would not be inlined here.
    let a = sheared(rays, corners.v[0]);
    let b = sheared(rays, corners.v[1]);
    let c = sheared(rays, corners.v[2]);
    for lane in 0..LANES {
        let (ox, oy) = (rays.sheared[0][lane], rays.sheared[1][lane]);
        let (ax, ay, bx, by) = (a.x - ox, a.y - oy, b.x - ox, b.y - oy);
        let (cx, cy) = (c.x - ox, c.y - oy);
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        let inside = (min(min(u, v), w) >= 0.0) | (max(max(u, v), w) <= 0.0);
        let det = u + v + w;
        // The depth of an edge-on triangle is NaN; the comparison below is then false, so it is not
        // hit.
        let depth = (u * a.z + v * b.z + w * c.z) / det - rays.sheared[2][lane];
        let hit = inside & (depth * shear.z > rays.start[lane]) & (corners.id != rays.own[lane]);
        rays.open[lane] &= !hit;
    }
}
