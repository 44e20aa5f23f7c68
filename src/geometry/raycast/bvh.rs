//! The bounding volume hierarchy: built by obvhs, laid out for packet traversal.

use super::node::{Node, Wide, widened};
use glam::{DVec3, Vec3};
use obvhs::aabb::Aabb;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::{BvhBuildParams, bvh2::Bvh2};

/// Index that means "no triangle".
pub const NO_TRIANGLE: u32 = u32::MAX;

/// Corners of a triangle. The triangles of a leaf are contiguous.
#[derive(Debug, Clone, Copy)]
pub struct Corners {
    /// Corner positions in millimetres.
    pub v: [Vec3; 3],
    /// Index of the triangle in the caller's list.
    pub id: u32,
}

/// A bounding volume hierarchy over triangles.
#[derive(Debug, Clone, Default)]
pub struct Bvh {
    pub(super) nodes: Vec<Node>,
    pub(super) triangles: Vec<Corners>,
    /// The same hierarchy with eight children per node, for packets of rays that hardly diverge.
    pub(super) wide: Vec<Wide>,
}

impl Bvh {
    /// Builds a hierarchy over indexed triangles, in millimetres. Each vertex is rounded to f32
    /// once, so that triangles that share a vertex still share it. Degenerate triangles are never
    /// hit.
    pub fn build(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let rounded: Vec<Vec3> = vertices.iter().map(|v| v.as_vec3()).collect();
        let corners = |t: &[u32; 3]| t.map(|i| rounded[i as usize]);
        let boxes: Vec<Aabb> = triangles
            .iter()
            .map(|t| {
                let [a, b, c] = corners(t);
                Aabb::new(a.min(b).min(c).into(), a.max(b).max(c).into())
            })
            .collect();
        if boxes.is_empty() {
            return Self::default();
        }
        let mut unused = std::time::Duration::ZERO;
        let params = BvhBuildParams::medium_build();
        Self::from_tree(&build_bvh2(&boxes, params, &mut unused), |id| {
            corners(&triangles[id as usize])
        })
    }

    fn from_tree(tree: &Bvh2, corners: impl Fn(u32) -> [Vec3; 3]) -> Self {
        let nodes: Vec<_> = tree
            .nodes
            .iter()
            .map(|node| Node {
                min: node.aabb.min.into(),
                first: node.first_index,
                max: node.aabb.max.into(),
                count: node.prim_count,
            })
            .collect();
        let triangles = tree
            .primitive_indices
            .iter()
            .map(|&id| Corners { v: corners(id), id })
            .collect();
        let wide = widened(&nodes);
        Self {
            nodes,
            triangles,
            wide,
        }
    }

    /// Returns the nodes: the root, then pairs of children.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Returns the triangles, leaf by leaf.
    pub fn corners(&self) -> &[Corners] {
        &self.triangles
    }

    /// Returns the number of nodes on the longest path from the root to a leaf.
    pub fn levels(&self) -> usize {
        let mut deepest = 0;
        let mut open = Vec::from_iter(self.nodes.first().map(|root| (root, 1)));
        while let Some((node, level)) = open.pop() {
            deepest = deepest.max(level);
            if node.count == 0 {
                let first = node.first as usize;
                open.extend(self.nodes[first..first + 2].iter().map(|n| (n, level + 1)));
            }
        }
        deepest
    }

    /// Returns the number of triangles.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Returns whether there are no triangles.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }
}
