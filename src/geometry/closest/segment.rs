//! Line-of-sight test between two points.

use super::MeshTree;
use super::triangle::crossing;
use glam::DVec3;

impl MeshTree {
    /// Returns whether the mesh crosses the segment from `from` to `to`. `margin_mm` is left out at
    /// both ends, so that the surface on which an end lies does not count.
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
