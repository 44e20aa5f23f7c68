//! Nodes of the hierarchy: binary ones, and ones with eight children.

use glam::Vec3;

/// Number of children of a wide node.
pub(super) const CHILDREN: usize = 8;

/// A 32-byte node.
#[derive(Debug, Clone, Copy)]
pub struct Node {
    /// Lowest corner of the box.
    pub min: Vec3,
    /// Index of the first of two children, or of the first triangle of a leaf.
    pub first: u32,
    /// Highest corner of the box.
    pub max: Vec3,
    /// Number of triangles of a leaf; 0 in an inner node.
    pub count: u32,
}

/// A node with up to eight children.
#[derive(Debug, Clone)]
pub(super) struct Wide {
    /// Lowest x, y, z and highest x, y, z of each child's box; the box of an absent child is
    /// inverted, so that it is never hit.
    pub(super) bounds: [[f32; CHILDREN]; 6],
    /// Index of each child among the wide nodes, or of the first triangle of a leaf.
    pub(super) first: [u32; CHILDREN],
    /// Number of triangles of each child that is a leaf; 0 for inner nodes.
    pub(super) count: [u32; CHILDREN],
    /// Index of each child among the binary nodes.
    binary: [u32; CHILDREN],
}

impl Wide {
    const EMPTY: Self = {
        let (low, high) = ([f32::INFINITY; CHILDREN], [f32::NEG_INFINITY; CHILDREN]);
        Self {
            bounds: [low, low, low, high, high, high],
            first: [0; CHILDREN],
            count: [0; CHILDREN],
            binary: [u32::MAX; CHILDREN],
        }
    };
}

/// Builds wide nodes from binary ones. The child with the largest surface is replaced by its own two
/// children until a node has eight.
pub(super) fn widened(nodes: &[Node]) -> Vec<Wide> {
    let mut wide = Vec::new();
    if nodes.is_empty() {
        return wide;
    }
    let children = |index: u32| {
        let node = &nodes[index as usize];
        match node.count {
            0 => vec![node.first, node.first + 1],
            _ => vec![index],
        }
    };
    let area = |index: u32| {
        let node = &nodes[index as usize];
        let Vec3 { x, y, z } = node.max - node.min;
        x * y + y * z + z * x
    };
    let is_inner = |index: u32| nodes[index as usize].count == 0;
    // Binary nodes, each of which becomes the wide node of the same number.
    let mut tops = vec![0];
    while let Some(&top) = tops.get(wide.len()) {
        let mut found = children(top);
        while found.len() < CHILDREN {
            let inner = (0..found.len()).filter(|&k| is_inner(found[k]));
            let largest = inner.max_by(|&a, &b| area(found[a]).total_cmp(&area(found[b])));
            let Some(largest) = largest else { break };
            let replaced = found.swap_remove(largest);
            found.extend(children(replaced));
        }
        let mut node = Wide::EMPTY;
        for (k, &child) in found.iter().enumerate() {
            let binary = &nodes[child as usize];
            node.binary[k] = child;
            node.count[k] = binary.count;
            node.first[k] = match binary.count {
                0 => tops.len() as u32,
                _ => binary.first,
            };
            if binary.count == 0 {
                tops.push(child);
            }
        }
        wide.push(node);
    }
    refit(&mut wide, nodes);
    wide
}

/// Copies the boxes of binary nodes to the wide nodes that were built from them.
pub(super) fn refit(wide: &mut [Wide], nodes: &[Node]) {
    for node in wide {
        for k in 0..CHILDREN {
            let Some(binary) = nodes.get(node.binary[k] as usize) else {
                break;
            };
            for axis in 0..3 {
                node.bounds[axis][k] = binary.min[axis];
                node.bounds[axis + 3][k] = binary.max[axis];
            }
        }
    }
}
