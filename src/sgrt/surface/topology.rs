//! Adjacency of triangles at edges and corners.

use std::collections::HashMap;

/// No adjacent triangle.
pub(super) const BORDER: u32 = u32::MAX;

/// The neighbours of triangles.
pub(super) struct Topology {
    /// The triangle across each edge from corner k to k + 1; [`BORDER`] if there is none or more than
    /// one, because the continuation of the surface is then ambiguous.
    pub(super) across: Vec<[u32; 3]>,
    /// Start of each vertex's triangles in `ring`, plus the end of the last.
    first: Vec<u32>,
    ring: Vec<u32>,
    /// Whether a vertex lies on a border.
    pub(super) on_border: Vec<bool>,
}

impl Topology {
    pub(super) fn new(vertices: usize, triangles: &[[u32; 3]]) -> Self {
        let mut edges: HashMap<(u32, u32), (u32, u8)> =
            HashMap::with_capacity(triangles.len() * 3 / 2);
        let ends = |t: &[u32; 3], k: usize| {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            (a.min(b), a.max(b))
        };
        // Sum the two triangle indices at each edge: subtracting one index from the sum gives the other.
        for (i, t) in triangles.iter().enumerate() {
            for k in 0..3 {
                let entry = edges.entry(ends(t, k)).or_insert((0, 0));
                entry.0 = entry.0.wrapping_add(i as u32);
                entry.1 = entry.1.saturating_add(1);
            }
        }
        let mut on_border = vec![false; vertices];
        let mut across = vec![[BORDER; 3]; triangles.len()];
        for (i, t) in triangles.iter().enumerate() {
            for k in 0..3 {
                let (sum, count) = edges[&ends(t, k)];
                if count == 2 {
                    across[i][k] = sum.wrapping_sub(i as u32);
                } else {
                    on_border[t[k] as usize] = true;
                    on_border[t[(k + 1) % 3] as usize] = true;
                }
            }
        }
        let mut first = vec![0_u32; vertices + 1];
        for &v in triangles.iter().flatten() {
            first[v as usize + 1] += 1;
        }
        for v in 0..vertices {
            first[v + 1] += first[v];
        }
        let mut next = first.clone();
        let mut ring = vec![0; triangles.len() * 3];
        for (i, t) in triangles.iter().enumerate() {
            for &v in t {
                ring[next[v as usize] as usize] = i as u32;
                next[v as usize] += 1;
            }
        }
        Self {
            across,
            first,
            ring,
            on_border,
        }
    }

    /// The triangles at a vertex.
    pub(super) fn ring(&self, vertex: u32) -> &[u32] {
        let v = vertex as usize;
        &self.ring[self.first[v] as usize..self.first[v + 1] as usize]
    }
}
