//! Casts packets: nearest hits and occlusion.

use super::bvh::{Bvh, Corners, NO_TRIANGLE};
use super::packet::{LANES, Packet, Scratch, UNUSED};
use super::traverse::{Test, walk};
use super::triangle::{Hit, intersect};
use super::wide::{self, Pyramid};
use phasmid_core::simd::widest;

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

#[inline(always)]
fn nearest_body(bvh: &Bvh, packet: &mut Packet, scratch: &mut Scratch) {
    match Pyramid::new(packet) {
        Some(pyramid) => wide::walk::<Nearest>(bvh, &pyramid, packet, scratch),
        None => walk::<Nearest>(bvh, packet, scratch),
    }
}

#[inline(always)]
fn blocked_body(bvh: &Bvh, packet: &mut Packet, scratch: &mut Scratch) {
    match Pyramid::new(packet) {
        Some(pyramid) => wide::walk::<Blocked>(bvh, &pyramid, packet, scratch),
        None => walk::<Blocked>(bvh, packet, scratch),
    }
}

pub(super) struct Nearest;

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
