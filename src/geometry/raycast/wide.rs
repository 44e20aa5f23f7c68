//! Nodes with eight children, for packets of rays that hardly diverge.
//!
//! The children's boxes are tested against a pyramid that encloses the packet's rays: eight boxes
//! against four planes in a few instructions, where the binary hierarchy tests each box against each
//! of sixteen rays (Boulos, Wald, Shirley: "Geometric and Arithmetic Culling Methods for Entire Ray
//! Packets", University of Utah report UUCS-06-010, 2006).

use super::bvh::Bvh;
use super::node::{CHILDREN, Wide};
use super::packet::{LANES, Packet, Scratch, UNUSED, max, min};
use super::traverse::{Test, farthest};

/// Maximum width of a packet's pyramid at unit distance. Wider packets use the binary hierarchy,
/// because they would test many triangles that no ray meets. At this width both take about the same
/// time on a mesh of 100,000 triangles that fills the image.
const WIDEST: f32 = 0.0125;
/// Relative widening of the pyramid, above the rounding errors of slopes, products and differences.
const MARGIN: f32 = 16.0 * f32::EPSILON;

/// A plane through the packet's origin, perpendicular to one of the axes of its pyramid's base.
#[derive(Debug, Clone, Copy, Default)]
struct Plane {
    /// Rows of [`Wide::bounds`] of the corner that lies farthest inwards, across and along the
    /// dominant axis.
    rows: [usize; 2],
    /// Components of the normal across and along the dominant axis. The normal points inwards.
    normal: [f32; 2],
    /// The packet's origin, across and along the dominant axis.
    origin: [f32; 2],
}

/// A pyramid around the rays of a packet, with its apex in their common origin.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pyramid {
    planes: [Plane; 4],
    /// Rows of [`Wide::bounds`] of the box's near and far side along the dominant axis.
    rows: [usize; 2],
    /// The origin along the dominant axis.
    origin: f32,
    /// Sign of the rays along the dominant axis.
    sign: f32,
    /// Smallest ray parameter at a signed unit distance along the dominant axis.
    soonest: f32,
}

impl Pyramid {
    /// Returns the pyramid around a packet's rays; `None` if they diverge too much.
    #[inline(always)]
    pub(super) fn new(packet: &Packet) -> Option<Self> {
        let [kx, ky, kz] = packet.axes.k;
        let mut fastest = 0.0f32;
        let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        let (mut forth, mut back) = (false, false);
        for lane in 0..LANES {
            if packet.reach[lane] == UNUSED {
                continue;
            }
            let along = packet.direction[kz][lane];
            fastest = max(fastest, along.abs());
            forth |= along > 0.0;
            back |= !(along > 0.0);
            for side in 0..2 {
                // Slopes relative to the dominant axis, which the triangle test uses as well.
                let slope = packet.axes.shear[side][lane];
                low[side] = min(low[side], slope);
                high[side] = max(high[side], slope);
            }
        }
        let narrow = high[0] - low[0] <= WIDEST && high[1] - low[1] <= WIDEST;
        if forth == back || !narrow {
            return None;
        }
        let sign = if forth { 1.0 } else { -1.0 };
        let mut planes = [Plane::default(); 4];
        for side in 0..2 {
            let k = if side == 0 { kx } else { ky };
            let origin = [packet.origin[k], packet.origin[kz]];
            // Slopes are relative to the signed axis: x lies between low z and high z for z > 0, and
            // between high z and low z for z < 0.
            let ends = [
                low[side] - low[side].abs() * MARGIN,
                high[side] + high[side].abs() * MARGIN,
            ];
            for end in 0..2 {
                let inwards = if end == 0 { sign } else { -sign };
                let normal = [inwards, -inwards * ends[end]];
                let row = |axis: usize, towards: f32| axis + if towards > 0.0 { 3 } else { 0 };
                planes[2 * side + end] = Plane {
                    rows: [row(k, normal[0]), row(kz, normal[1])],
                    normal,
                    origin,
                };
            }
        }
        Some(Self {
            planes,
            rows: if forth { [kz, kz + 3] } else { [kz + 3, kz] },
            origin: packet.origin[kz],
            sign,
            soonest: sign * (1.0 - MARGIN) / fastest,
        })
    }

    /// Returns a mask of the children that a ray may enter before `end`, and lower bounds of the
    /// parameters at which rays enter them.
    #[inline(always)]
    fn entered(&self, node: &Wide, end: f32) -> (u32, [f32; CHILDREN]) {
        let mut inside = [f32::INFINITY; CHILDREN];
        for plane in &self.planes {
            let across = &node.bounds[plane.rows[0]];
            let along = &node.bounds[plane.rows[1]];
            for k in 0..CHILDREN {
                let x = (across[k] - plane.origin[0]) * plane.normal[0];
                let z = (along[k] - plane.origin[1]) * plane.normal[1];
                inside[k] = min(inside[k], x + z);
            }
        }
        let mut entry = [0.0f32; CHILDREN];
        let mut mask = 0;
        for k in 0..CHILDREN {
            let near = (node.bounds[self.rows[0]][k] - self.origin) * self.soonest;
            let far = (node.bounds[self.rows[1]][k] - self.origin) * self.sign;
            entry[k] = max(near, 0.0);
            let enters = (inside[k] >= 0.0) & (far >= 0.0) & (near <= end);
            mask |= u32::from(enters) << k;
        }
        (mask, entry)
    }
}

/// Visits the leaves that the pyramid meets, near ones first, and tests each of their triangles.
#[inline(always)]
pub(super) fn walk<T: Test>(
    bvh: &Bvh,
    pyramid: &Pyramid,
    packet: &mut Packet,
    scratch: &mut Scratch,
) {
    scratch.stack.clear();
    let mut end = farthest(packet);
    let mut index = 0;
    loop {
        let node = &bvh.wide[index];
        let (mut mask, entries) = pyramid.entered(node, end);
        let bottom = scratch.stack.len();
        while mask != 0 {
            let k = mask.trailing_zeros();
            mask &= mask - 1;
            let from = entries[k as usize];
            scratch
                .stack
                .push((index as u32 * CHILDREN as u32 + k, from));
            // Near children end up on top.
            let mut at = scratch.stack.len() - 1;
            while at > bottom && scratch.stack[at - 1].1 < from {
                scratch.stack.swap(at - 1, at);
                at -= 1;
            }
        }
        loop {
            let Some((child, distance)) = scratch.stack.pop() else {
                return;
            };
            // A node on the stack may now lie behind a hit found later.
            if distance > end {
                continue;
            }
            let (node, k) = (
                &bvh.wide[child as usize / CHILDREN],
                child as usize % CHILDREN,
            );
            let (first, count) = (node.first[k] as usize, node.count[k] as usize);
            if count == 0 {
                index = first;
                break;
            }
            for corners in &bvh.triangles[first..first + count] {
                T::test(packet, scratch, corners);
            }
            end = farthest(packet);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raycast::cast::Nearest;
    use crate::raycast::{NO_TRIANGLE, traverse};
    use crate::shapes;
    use glam::{DVec3, Vec3};

    /// Narrow packets around the directions to corners of a mesh, from all sides and from inside,
    /// have the same hits by both hierarchies.
    #[test]
    fn both_hierarchies_give_the_same_hits() {
        let mesh = shapes::torso(&shapes::Torso {
            triangles: 3000,
            ..shapes::Torso::default()
        });
        let bvh = Bvh::build(&mesh.vertices, &mesh.triangles);
        let (low, high) = mesh.bounds().unwrap();
        let middle = (low + high) / 2.0;
        let sides = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE, DVec3::ZERO];
        let (mut hits, mut misses) = (0, 0);
        for side in sides.into_iter().flat_map(|side| [side, -side]) {
            let origin = (middle + side * 900.0).as_vec3();
            for (number, corner) in mesh.vertices.iter().enumerate() {
                let axis = corner.as_vec3() - origin;
                let directions = std::array::from_fn(|lane| {
                    let (sin, cos) = (lane as f32 * 2.4).sin_cos();
                    axis + Vec3::new(sin, cos, sin * cos) * (lane as f32 * 2e-4 * axis.length())
                });
                let used = if number % 5 == 0 {
                    1 + number % LANES
                } else {
                    LANES
                };
                let ends = std::array::from_fn(|lane| match lane < used {
                    true => f32::INFINITY,
                    false => -1.0,
                });
                let mut wide = Packet::new(origin, &directions, &ends);
                let mut binary = wide.clone();
                let pyramid = Pyramid::new(&wide).expect("a narrow packet");
                let mut scratch = Scratch::default();
                walk::<Nearest>(&bvh, &pyramid, &mut wide, &mut scratch);
                traverse::walk::<Nearest>(&bvh, &mut binary, &mut scratch);
                assert_eq!(wide.t, binary.t, "towards {corner} from {origin}");
                let seen = wide
                    .triangle
                    .iter()
                    .filter(|id| **id != NO_TRIANGLE)
                    .count();
                (hits, misses) = (hits + seen, misses + used - seen);
            }
        }
        assert!(hits > 100_000 && misses > 5000, "{hits} {misses}");
    }
}
