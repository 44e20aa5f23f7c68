//! The nearest point of a mesh to a point, and whether a mesh stands between two points, in f64
//! over a bounding volume hierarchy.
//!
//! Boxes are f32, rounded outwards, so they bound the f64 corners strictly; every distance is
//! computed in f64. This is the measure of truth: it shares no code with the renderer.

use super::Mesh;
use glam::{DVec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::{Boundable, BvhBuildParams};
use rayon::prelude::*;

/// A mesh ready for queries.
pub struct MeshTree {
    nodes: Vec<Node>,
    /// Corners in the order of the leaves.
    corners: Vec<[DVec3; 3]>,
    /// Index in the mesh of each of `corners`.
    triangles: Vec<u32>,
}

/// Where a mesh is nearest to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closest {
    /// The nearest point of the mesh, in millimetres.
    pub point: DVec3,
    /// Distance to it in millimetres.
    pub distance_mm: f64,
    /// Index in the mesh of a triangle that holds it.
    pub triangle: u32,
    /// Unit normal of that triangle by its winding; zero for a degenerate one.
    pub normal: DVec3,
}

struct Node {
    lo: [f32; 3],
    hi: [f32; 3],
    /// First of two children, or of the leaf's triangles.
    first: u32,
    /// Triangles of a leaf, 0 for an inner node.
    count: u32,
}

struct Bounded(Aabb);

impl Boundable for Bounded {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

impl MeshTree {
    /// Builds the tree over a mesh that is [checked](Mesh::checked).
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

    /// The nearest point of the mesh to `p`, both in the mesh's frame; `None` for a mesh without
    /// triangles or a `p` that is not finite.
    pub fn closest(&self, p: DVec3) -> Option<Closest> {
        self.search(p, &mut Vec::with_capacity(64))
    }

    /// [`Self::closest`] of many points, over all cores.
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
            // The nearer child is looked at first.
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

    /// Whether the mesh crosses the segment from `from` to `to`, leaving out `margin_mm` at both
    /// ends (so that the surface that an end lies on does not count).
    pub fn blocks(&self, from: DVec3, to: DVec3, margin_mm: f64) -> bool {
        let length = (to - from).length();
        // A segment of no or unknown length crosses nothing.
        if self.nodes.is_empty() || length.is_nan() || length <= 2.0 * margin_mm {
            return false;
        }
        let direction = (to - from) / length;
        // A component of zero would make 0 x infinity of a box that the origin touches.
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

impl Node {
    fn distance_squared(&self, p: DVec3) -> f64 {
        let (lo, hi) = (widened(self.lo), widened(self.hi));
        (lo - p).max(p - hi).max(DVec3::ZERO).length_squared()
    }

    fn meets(&self, from: DVec3, inverse: DVec3, near: f64, far: f64) -> bool {
        let a = (widened(self.lo) - from) * inverse;
        let b = (widened(self.hi) - from) * inverse;
        // A relative slack covers the rounding of the products.
        let enter = a.min(b).max_element().max(near);
        let leave = a.max(b).min_element().min(far);
        enter <= leave + 1e-12 * leave.abs()
    }
}

fn widened(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

/// The nearest f32 at or beyond each coordinate, on the side that `step` goes to.
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

/// The nearest point of a triangle: the foot of the perpendicular where that lies inside, else the
/// nearest point of an edge that the foot lies outside of (cf. C. Ericson, "Real-Time Collision
/// Detection", 2005, section 5.1.5; by edges rather than by barycentric regions, because those
/// divide by zero on a degenerate triangle).
pub(crate) fn closest_on_triangle(p: DVec3, &[a, b, c]: &[DVec3; 3]) -> DVec3 {
    let (ab, ac) = (b - a, c - a);
    let normal = ab.cross(ac);
    let squared = normal.length_squared();
    // Twice the area over the square of an edge: below this the normal's direction is noise.
    let degenerate = squared <= 1e-24 * ab.length_squared() * ac.length_squared();
    let mut best = (f64::INFINITY, a);
    let mut inside = !degenerate;
    for (from, to) in [(a, b), (b, c), (c, a)] {
        let edge = to - from;
        if degenerate || edge.cross(normal).dot(p - from) > 0.0 {
            inside = false;
            let length = edge.length_squared();
            let along = if length > 0.0 {
                ((p - from).dot(edge) / length).clamp(0.0, 1.0)
            } else {
                0.0
            };
            let q = from + edge * along;
            let d = (q - p).length_squared();
            if d < best.0 {
                best = (d, q);
            }
        }
    }
    if inside {
        p - normal * (normal.dot(p - a) / squared)
    } else {
        best.1
    }
}

/// Distance along a ray to a triangle, seen from either side (T. Moller and B. Trumbore, "Fast,
/// Minimum Storage Ray/Triangle Intersection", 1997). Edges count as hit, with a slack that lets no
/// ray through between two triangles.
fn crossing(from: DVec3, direction: DVec3, &[a, b, c]: &[DVec3; 3]) -> Option<f64> {
    const SLACK: f64 = 1e-9;
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let s = (from - a) / determinant;
    let u = s.dot(p);
    let q = s.cross(ab);
    let v = direction.dot(q);
    (u >= -SLACK && v >= -SLACK && u + v <= 1.0 + SLACK).then(|| ac.dot(q))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Pseudo-random numbers in [0, 1).
    fn noise(count: usize, seed: u64) -> Vec<f64> {
        let mut state = seed;
        (0..count)
            .map(|_| {
                state = state
                    .wrapping_mul(6364136223846793005)
                    .wrapping_add(1442695040888963407);
                (state >> 11) as f64 / (1_u64 << 53) as f64
            })
            .collect()
    }

    fn soup(triangles: usize, seed: u64) -> Mesh {
        let raw = noise(triangles * 9, seed);
        let mut vertices = Vec::new();
        for t in raw.chunks_exact(9) {
            let base = DVec3::new(t[0], t[1], t[2]) * 1000.0;
            vertices.extend([
                base,
                base + DVec3::new(t[3], t[4], t[5]) * 40.0,
                base + DVec3::new(t[6], t[7], t[8]) * 40.0,
            ]);
        }
        Mesh {
            triangles: (0..triangles as u32)
                .map(|i| match i % 7 {
                    // A needle, a point, and twins.
                    0 => [3 * i, 3 * i + 1, 3 * i],
                    1 => [3 * i; 3],
                    2 => [3 * i - 3, 3 * i - 3, 3 * i - 3],
                    _ => [3 * i, 3 * i + 1, 3 * i + 2],
                })
                .collect(),
            vertices,
        }
    }

    /// By minimising over a fine grid of barycentric coordinates: an upper bound that is tight to
    /// the grid's width.
    fn by_grid(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
        let n = 200;
        let mut best = f64::INFINITY;
        for i in 0..=n {
            for j in 0..=(n - i) {
                let (u, v) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                best = best.min((a + (b - a) * u + (c - a) * v - p).length());
            }
        }
        best
    }

    #[test]
    fn tree_agrees_with_brute_force() {
        let mesh = soup(600, 3);
        let tree = MeshTree::new(&mesh);
        let points: Vec<DVec3> = noise(900, 9)
            .chunks_exact(3)
            .map(|c| (DVec3::new(c[0], c[1], c[2]) * 1.4 - 0.2) * 1000.0)
            .collect();
        for (p, found) in points.iter().zip(tree.closest_batch(&points)) {
            let found = found.unwrap();
            let brute = (0..mesh.triangles.len())
                .map(|i| (closest_on_triangle(*p, &mesh.corners(i)) - *p).length())
                .fold(f64::INFINITY, f64::min);
            assert_eq!(found.distance_mm, brute);
            let own = closest_on_triangle(*p, &mesh.corners(found.triangle as usize));
            assert_eq!(own, found.point);
        }
    }

    #[test]
    fn ten_thousand_coincident_triangles() {
        let mesh = Mesh {
            vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
            triangles: vec![[0, 1, 2]; 10_000],
        };
        let found = MeshTree::new(&mesh)
            .closest(DVec3::new(0.2, 0.2, 3.0))
            .unwrap();
        assert_eq!(found.distance_mm, 3.0);
        assert_eq!(found.normal, DVec3::Z);
    }

    #[test]
    fn far_from_the_origin_the_boxes_still_hold() {
        // At 1e8 mm an f32 step is 8 mm, wider than the triangles.
        let shift = DVec3::new(1e8, -1e8, 1e8);
        let mut mesh = soup(200, 5);
        mesh.vertices.iter_mut().for_each(|v| *v += shift);
        let tree = MeshTree::new(&mesh);
        for c in noise(300, 2).chunks_exact(3) {
            let p = shift + DVec3::new(c[0], c[1], c[2]) * 1000.0;
            let brute = (0..mesh.triangles.len())
                .map(|i| (closest_on_triangle(p, &mesh.corners(i)) - p).length())
                .fold(f64::INFINITY, f64::min);
            assert_eq!(tree.closest(p).unwrap().distance_mm, brute);
        }
    }

    #[test]
    fn nothing_to_find() {
        let tree = MeshTree::new(&Mesh::default());
        assert_eq!(tree.closest(DVec3::ZERO), None);
        assert!(!tree.blocks(DVec3::ZERO, DVec3::X, 0.0));
        let tree = MeshTree::new(&soup(10, 1));
        assert_eq!(tree.closest(DVec3::NAN), None);
    }

    #[test]
    fn a_wall_blocks_what_crosses_it() {
        let mesh = Mesh {
            vertices: vec![
                DVec3::new(-1.0, -1.0, 5.0),
                DVec3::new(1.0, -1.0, 5.0),
                DVec3::new(1.0, 1.0, 5.0),
                DVec3::new(-1.0, 1.0, 5.0),
            ],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        };
        let tree = MeshTree::new(&mesh);
        let blocks = |x, y, z| tree.blocks(DVec3::ZERO, DVec3::new(x, y, z), 1e-6);
        // Along the shared diagonal, along an axis, and beside the wall.
        assert!(blocks(0.0, 0.0, 10.0));
        assert!(blocks(1.0, 1.0, 10.0));
        assert!(blocks(0.5, -0.2, 6.0));
        assert!(!blocks(0.0, 0.0, 4.0));
        assert!(!blocks(0.0, 0.0, 5.0));
        assert!(!blocks(2.2, 0.0, 10.0));
        assert!(!blocks(0.0, 0.0, -10.0));
    }

    #[test]
    fn no_ray_slips_between_triangles() {
        let mesh = crate::geometry::shapes::torso(&crate::geometry::shapes::Torso {
            triangles: 4000,
            ..Default::default()
        });
        let (lo, hi) = mesh.bounds().unwrap();
        let tree = MeshTree::new(&mesh);
        let middle = (lo + hi) / 2.0;
        for (a, b) in noise(4000, 8).chunks_exact(2).map(|c| (c[0], c[1])) {
            let (sin, cos) = (std::f64::consts::TAU * a).sin_cos();
            let up = 2.0 * b - 1.0;
            let out = DVec3::new(cos, sin, 0.0) * (1.0 - up * up).sqrt() + DVec3::Z * up;
            assert!(tree.blocks(middle, middle + out * 2000.0, 1e-6));
        }
        // Straight at the vertices and the middles of edges, too.
        for i in (0..mesh.triangles.len()).step_by(7) {
            let [a, b, _] = mesh.corners(i);
            for at in [a, (a + b) / 2.0] {
                assert!(tree.blocks(middle, middle + (at - middle) * 1.5, 1e-6));
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        #[test]
        fn nearest_point_of_a_triangle(raw in proptest::collection::vec(-10.0_f64..10.0, 12),
            collapse in 0..5_u8)
        {
            let v: Vec<DVec3> = raw.chunks_exact(3).map(|c| DVec3::new(c[0], c[1], c[2])).collect();
            let mut t = [v[1], v[2], v[3]];
            match collapse {
                0 => t[2] = t[0],
                1 => t[2] = t[0] * 0.25 + t[1] * 0.75,
                2 => t[2] = t[1] + DVec3::X * 1e-7,
                _ => {}
            }
            let q = closest_on_triangle(v[0], &t);
            let d = (q - v[0]).length();
            let grid = by_grid(v[0], t);
            let step = (t[1] - t[0]).length().max((t[2] - t[0]).length()) / 200.0;
            prop_assert!(d <= grid + 1e-9, "{} above {}", d, grid);
            prop_assert!(d >= grid - 2.0 * step, "{} too near, {}", d, grid);
        }
    }
}
