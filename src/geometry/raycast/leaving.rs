//! Rays that leave a surface point in all directions: the nearest triangle along each.
//!
//! The rays lack the common direction that the shear of [`super::triangle`] needs, and the exact
//! hit point is not visible, so the plain test suffices (Moller and Trumbore: "Fast, Minimum
//! Storage Ray/Triangle Intersection", Journal of Graphics Tools 2(1), 1997). With a common origin
//! its products are three dot products per lane. Triangles are enlarged slightly, so that no ray
//! passes between them.

use super::bvh::{Bvh, Corners};
use super::packet::{LANES, Packet, Scratch};
use super::traverse::{Test, walk};
use glam::Vec3;
use phasmid_core::simd::widest;

/// Enlargement of a triangle beyond its edges, as a fraction of its sides.
const OVERLAP: f32 = 1e-6;
/// Relative tolerance, 4 f32 epsilons, within which an origin counts as lying in a triangle's
/// plane.
const ROUNDING: f32 = 4.0 * f32::EPSILON;

impl Bvh {
    /// Finds each lane's nearest hit before its end, in f32, and stores it in `packet.t` and
    /// `packet.triangle`. Triangles in whose plane the origin lies, within f32 precision, are
    /// skipped: they belong to the surface that the rays leave.
    pub fn leaving(&self, packet: &mut Packet, scratch: &mut Scratch) {
        if !self.nodes.is_empty() {
            leaving(self, packet, scratch);
        }
    }
}

widest! {
    fn leaving(bvh: &Bvh, packet: &mut Packet, scratch: &mut Scratch) => leaving_body
}

#[inline(always)]
fn leaving_body(bvh: &Bvh, packet: &mut Packet, scratch: &mut Scratch) {
    walk::<Leaving>(bvh, packet, scratch);
}

struct Leaving;

impl Test for Leaving {
    #[inline(always)]
    fn test(packet: &mut Packet, _: &mut Scratch, corners: &Corners) {
        intersect(packet, corners);
    }
}

/// With s from the first corner to the origin, n = e1 x e2 and det = -d . n:
/// t = s . n / det, u = d . (e2 x s) / det, v = d . (s x e1) / det.
#[inline(always)]
fn intersect(packet: &mut Packet, corners: &Corners) {
    let [a, b, c] = corners.v;
    let (e1, e2, s) = (b - a, c - a, packet.origin - a);
    let n = e1.cross(e2);
    let height = s.dot(n);
    let size = s.abs().max_element() + packet.farthest;
    if height.abs() <= ROUNDING * size * n.length() {
        return;
    }
    let (across, along) = (e2.cross(s), s.cross(e1));
    let mut t = [0.0f32; LANES];
    let mut nearer = [false; LANES];
    for lane in 0..LANES {
        let d = Vec3::new(
            packet.direction[0][lane],
            packet.direction[1][lane],
            packet.direction[2][lane],
        );
        let one = -1.0 / d.dot(n);
        let (u, v) = (d.dot(across) * one, d.dot(along) * one);
        t[lane] = height * one;
        // NaN, for rays in the plane, is not a hit.
        nearer[lane] = (u >= -OVERLAP)
            & (v >= -OVERLAP)
            & (u + v <= 1.0 + OVERLAP)
            & (t[lane] > 0.0)
            & (t[lane] < packet.reach[lane]);
    }
    for lane in 0..LANES {
        if nearer[lane] {
            packet.t[lane] = t[lane];
            packet.reach[lane] = t[lane];
            packet.triangle[lane] = corners.id;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::NO_TRIANGLE;
    use super::*;
    use glam::DVec3;

    /// Directions distributed over the unit sphere (Vogel's spiral).
    fn direction(i: usize, count: usize) -> Vec3 {
        let z = 1.0 - (2.0 * i as f32 + 1.0) / count as f32;
        let (sin, cos) = (i as f32 * 2.399_963_2).sin_cos();
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * cos, r * sin, z)
    }

    /// Triangles of various sizes around the origin, some of which share a vertex.
    fn soup() -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let mut vertices = Vec::new();
        for i in 0..600 {
            let place = direction(i % 211, 211).as_dvec3() * (30.0 + f64::from(i as u32 % 37));
            let side = |k: usize| direction((7 * i + k) % 101, 101).as_dvec3() * 9.0;
            vertices.extend([place, place + side(0), place + side(50)]);
        }
        let triangles = (0..600).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        (vertices, triangles)
    }

    #[test]
    fn agrees_with_brute_force_in_f64() {
        let (vertices, triangles) = soup();
        let bvh = Bvh::build(&vertices, &triangles);
        let (mut hits, mut scratch) = (0, Scratch::default());
        for k in 0..200 {
            // Every second origin lies on a triangle; rays do not hit that triangle.
            let own = k % 2 * (1 + k);
            let [a, b, c] = triangles[own].map(|i| vertices[i as usize]);
            let origin = if k % 2 == 1 {
                (a + b + c) / 3.0
            } else {
                direction(k, 200).as_dvec3() * 5.0
            };
            let directions = std::array::from_fn(|lane| direction(16 * k + lane, 3200));
            let mut packet = Packet::new(origin.as_vec3(), &directions, &[f32::INFINITY; LANES]);
            bvh.leaving(&mut packet, &mut scratch);
            for (lane, direction) in directions.iter().enumerate() {
                let d = direction.as_dvec3();
                let nearest = (0..triangles.len())
                    .filter(|&i| k % 2 == 0 || i != own)
                    .filter_map(|i| {
                        let [a, b, c] = triangles[i].map(|i| vertices[i as usize] - origin);
                        let n = (b - a).cross(c - a);
                        let t = n.dot(a) / n.dot(d);
                        let inside = [(a, b), (b, c), (c, a)]
                            .map(|(p, q)| d.dot(p.cross(q)) * d.dot(n) >= 0.0);
                        (t > 0.0 && inside == [true; 3]).then_some(t)
                    })
                    .fold(f64::INFINITY, f64::min);
                let found = f64::from(packet.t[lane]);
                let same = found == nearest || (found - nearest).abs() < 1e-3;
                assert!(same, "{k} {lane}: {found} {nearest}");
                assert_eq!(packet.triangle[lane] == NO_TRIANGLE, found.is_infinite());
                hits += usize::from(found.is_finite());
            }
        }
        assert!((400..2800).contains(&hits), "{hits}");
    }
}
