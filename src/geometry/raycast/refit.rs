//! Refits a hierarchy to moving triangles: the tree stays, its boxes are updated (Wald, Boulos,
//! Shirley: "Ray tracing deformable scenes using dynamic bounding volume hierarchies", ACM TOG
//! 26(1), 2007).

use super::bvh::Bvh;
use super::node::{self, Node, widened};
use glam::{DVec3, Vec3};

impl Bvh {
    /// Reorders the nodes so that children follow their parents, as [`Self::refit`] requires.
    pub fn ordered(self) -> Self {
        let mut nodes = Vec::with_capacity(self.nodes.len());
        nodes.extend(self.nodes.first().copied());
        let mut next = 0;
        while next < nodes.len() {
            let Node { first, count, .. } = nodes[next];
            if count == 0 {
                nodes[next].first = nodes.len() as u32;
                nodes.extend_from_slice(&self.nodes[first as usize..first as usize + 2]);
            }
            next += 1;
        }
        let wide = widened(&nodes);
        Self {
            nodes,
            wide,
            ..self
        }
    }

    /// Updates the hierarchy to new vertex positions; `triangles` must be the triangles over which it
    /// was built. The hierarchy must be [`Self::ordered`].
    pub fn refit(&mut self, vertices: &[DVec3], triangles: &[[u32; 3]]) {
        let rounded: Vec<Vec3> = vertices.iter().map(|v| v.as_vec3()).collect();
        for corners in &mut self.triangles {
            corners.v = triangles[corners.id as usize].map(|i| rounded[i as usize]);
        }
        for i in (0..self.nodes.len()).rev() {
            let Node { first, count, .. } = self.nodes[i];
            let first = first as usize;
            let (min, max) = if count == 0 {
                debug_assert!(first > i, "a child before its parent");
                let [a, b] = [self.nodes[first], self.nodes[first + 1]];
                (a.min.min(b.min), a.max.max(b.max))
            } else {
                let leaf = &self.triangles[first..first + count as usize];
                let all = leaf.iter().flat_map(|corners| corners.v);
                all.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), v| {
                    (min.min(v), max.max(v))
                })
            };
            (self.nodes[i].min, self.nodes[i].max) = (min, max);
        }
        node::refit(&mut self.wide, &self.nodes);
    }
}

#[cfg(test)]
mod tests {
    use crate::raycast::{Bvh, LANES, NO_TRIANGLE, Packet, Scratch};
    use crate::shapes;
    use glam::{DVec3, Vec3};

    fn hits(bvh: &Bvh) -> Vec<(u32, f32)> {
        let mut scratch = Scratch::default();
        let mut all = Vec::new();
        for row in -20..20 {
            let directions =
                std::array::from_fn(|i| Vec3::new((i as f32 - 7.5) * 0.05, row as f32 * 0.02, 1.0));
            let origin = Vec3::new(0.0, 0.0, -800.0);
            let mut packet = Packet::new(origin, &directions, &[f32::INFINITY; LANES]);
            bvh.nearest(&mut packet, &mut scratch);
            all.extend(packet.triangle.into_iter().zip(packet.t));
        }
        all
    }

    #[test]
    fn refitted_tree_gives_the_hits_of_a_fresh_one() {
        let mesh = shapes::torso(&shapes::Torso {
            triangles: 5000,
            ..shapes::Torso::default()
        });
        let fresh = Bvh::build(&mesh.vertices, &mesh.triangles);
        let mut moved = fresh.clone().ordered();
        assert_eq!(hits(&fresh), hits(&moved), "the order changes nothing");
        for k in 1..5 {
            // The mesh is bent, swollen and shifted more and more.
            let bend = |v: DVec3| {
                let swell = 1.0 + 0.1 * f64::from(k) * (v.y / 90.0).sin();
                DVec3::new(
                    v.x * swell + v.y * 0.1 * f64::from(k),
                    v.y,
                    v.z * swell - 9.0,
                )
            };
            let bent: Vec<DVec3> = mesh.vertices.iter().map(|&v| bend(v)).collect();
            moved.refit(&bent, &mesh.triangles);
            let (found, wanted) = (hits(&moved), hits(&Bvh::build(&bent, &mesh.triangles)));
            assert!(wanted.iter().filter(|h| h.0 != NO_TRIANGLE).count() > 100);
            // Where two triangles meet, either may be reported; the distance is the same.
            for (a, b) in found.iter().zip(&wanted) {
                assert!((a.1 - b.1).abs() <= 1e-6 * b.1 || a == b, "{a:?} {b:?}");
            }
        }
        // Restoring the original positions restores the original hierarchy.
        moved.refit(&mesh.vertices, &mesh.triangles);
        assert_eq!(hits(&moved), hits(&fresh));
        Bvh::default().ordered().refit(&[], &[]);
    }
}
