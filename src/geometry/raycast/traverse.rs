//! Traversal of the binary hierarchy by a packet, each of whose rays is tested against each box.

use super::bvh::{Bvh, Corners};
use super::node::Node;
use super::packet::{LANES, Packet, Scratch, max, min, reduce};

/// Widens the far plane by two units in the last place, so that rounding never culls a box that
/// the ray meets (Ize: "Robust BVH Ray Traversal", JCGT 2(2), 2013).
const FAR: f32 = 1.0 + 4.0 * f32::EPSILON;

/// Test of a triangle against a packet. It is a trait, because a closure would not be inlined into
/// [`widest!`] functions and would lack their instructions.
pub(super) trait Test {
    fn test(packet: &mut Packet, scratch: &mut Scratch, corners: &Corners);
}

/// Visits the leaves that a lane meets, near ones first, and tests each of their triangles.
#[inline(always)]
pub(super) fn walk<T: Test>(bvh: &Bvh, packet: &mut Packet, scratch: &mut Scratch) {
    scratch.stack.clear();
    let root = entry(&bvh.nodes[0], packet);
    if root == f32::INFINITY {
        return;
    }
    let mut index = 0;
    loop {
        let node = bvh.nodes[index as usize];
        if node.count > 0 {
            let first = node.first as usize;
            for corners in &bvh.triangles[first..first + node.count as usize] {
                T::test(packet, scratch, corners);
            }
        } else {
            // This does not use `map` over both children, because the closure of `map` would not be
            // inlined.
            let (one, other) = (node.first, node.first + 1);
            let left = entry(&bvh.nodes[one as usize], packet);
            let right = entry(&bvh.nodes[other as usize], packet);
            let (near, far) = if left <= right {
                ((one, left), (other, right))
            } else {
                ((other, right), (one, left))
            };
            if far.1 < f32::INFINITY {
                scratch.stack.push(far);
            }
            if near.1 < f32::INFINITY {
                index = near.0;
                continue;
            }
        }
        // A node on the stack may now lie behind a hit found later.
        let end = farthest(packet);
        loop {
            let Some((next, distance)) = scratch.stack.pop() else {
                return;
            };
            if distance <= end {
                index = next;
                break;
            }
        }
    }
}

/// Returns the largest reach of all lanes; -1 if no lane is in use any more.
#[inline(always)]
pub(super) fn farthest(packet: &Packet) -> f32 {
    max(reduce(packet.reach, max), -1.0)
}

/// Smallest parameter at which a lane enters the box; infinite if none does.
#[inline(always)]
fn entry(node: &Node, packet: &Packet) -> f32 {
    let low = node.min - packet.origin;
    let high = node.max - packet.origin;
    let mut enter = [0.0f32; LANES];
    for lane in 0..LANES {
        let mut near = 0.0f32;
        let mut far = f32::INFINITY;
        for axis in 0..3 {
            let inverse = packet.inverse[axis][lane];
            let (t0, t1) = (low[axis] * inverse, high[axis] * inverse);
            near = max(near, min(t0, t1));
            far = min(far, max(t0, t1));
        }
        let far = min(far * FAR, packet.reach[lane]);
        enter[lane] = if near <= far { near } else { f32::INFINITY };
    }
    reduce(enter, min)
}
