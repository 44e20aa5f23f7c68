//! Packet traversal of the hierarchy: nearest hits and occlusion.

use super::bvh::{Bvh, Corners, NO_TRIANGLE, Node};
use super::packet::{LANES, Packet, Scratch, UNUSED, max, min, reduce};
use super::triangle::{Hit, intersect};
use phasmid_core::simd::widest;

/// Widens the far plane by two units in the last place, so that rounding never culls a box that
/// the ray meets (Ize: "Robust BVH Ray Traversal", JCGT 2(2), 2013).
const FAR: f32 = 1.0 + 4.0 * f32::EPSILON;

impl Bvh {
    /// Finds each lane's nearest hit before its end and stores it in `packet.t` and
    /// `packet.triangle`. Other hits that may be the nearest, by the f32 error bounds, are added to
    /// `scratch.rivals`.
    pub fn nearest(&self, packet: &mut Packet, scratch: &mut Scratch) {
        self.cast(packet, scratch, nearest);
    }

    /// Finds for each lane whether anything lies before its end, other than the triangle in
    /// `packet.triangle`. Blocked lanes get a negative `packet.t`; hits for which f32 cannot decide
    /// whether they lie before the end are added to `scratch.rivals`.
    pub fn blocked(&self, packet: &mut Packet, scratch: &mut Scratch) {
        self.cast(packet, scratch, blocked);
    }

    /// Casts the packet; if its rays diverge too much for one shear, casts them one by one.
    fn cast(
        &self,
        packet: &mut Packet,
        scratch: &mut Scratch,
        walk: fn(&Self, &mut Packet, &mut Scratch),
    ) {
        scratch.rivals.clear();
        if self.nodes.is_empty() {
            return;
        }
        if packet.coherent {
            return walk(self, packet, scratch);
        }
        for lane in 0..LANES {
            if packet.t[lane] < 0.0 {
                continue;
            }
            let mut single = packet.only(lane);
            walk(self, &mut single, scratch);
            packet.t[lane] = single.t[lane];
            packet.reach[lane] = single.reach[lane];
            packet.triangle[lane] = single.triangle[lane];
        }
    }
}

widest! {
    fn nearest(bvh: &Bvh, packet: &mut Packet, scratch: &mut Scratch) => nearest_body
}
widest! {
    fn blocked(bvh: &Bvh, packet: &mut Packet, scratch: &mut Scratch) => blocked_body
}

/// Test of a triangle against a packet. It is a trait, because a closure would not be inlined into
/// [`widest!`] functions and would lack their instructions.
pub(super) trait Test {
    fn test(packet: &mut Packet, scratch: &mut Scratch, corners: &Corners);
}

#[inline(always)]
fn nearest_body(bvh: &Bvh, packet: &mut Packet, scratch: &mut Scratch) {
    walk::<Nearest>(bvh, packet, scratch);
}

#[inline(always)]
fn blocked_body(bvh: &Bvh, packet: &mut Packet, scratch: &mut Scratch) {
    walk::<Blocked>(bvh, packet, scratch);
}

struct Nearest;

impl Test for Nearest {
    #[inline(always)]
    fn test(packet: &mut Packet, scratch: &mut Scratch, corners: &Corners) {
        intersect(packet, corners, |packet, lane, hit| {
            let former = packet.t[lane];
            if hit.t >= former {
                return scratch.rival(lane, corners.id);
            }
            let error = packet.reach[lane] - former;
            if packet.triangle[lane] != NO_TRIANGLE && former - error < hit.t + hit.error {
                scratch.rival(lane, packet.triangle[lane]);
            }
            packet.t[lane] = hit.t;
            packet.reach[lane] = hit.t + hit.error;
            packet.triangle[lane] = corners.id;
        });
    }
}

struct Blocked;

impl Test for Blocked {
    #[inline(always)]
    fn test(packet: &mut Packet, scratch: &mut Scratch, corners: &Corners) {
        intersect(packet, corners, |packet, lane, hit: Hit| {
            if corners.id == packet.triangle[lane] {
                return;
            }
            if hit.t + hit.error < packet.t[lane] {
                packet.t[lane] = -1.0;
                packet.reach[lane] = UNUSED;
            } else {
                scratch.rival(lane, corners.id);
            }
        });
    }
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
        let end = packet
            .reach
            .iter()
            .fold(-1.0f32, |m, &t| if t > m { t } else { m });
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
