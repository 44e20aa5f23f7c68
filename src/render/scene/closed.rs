//! Meshes that enclose a volume.

use glam::DVec3;

/// Returns 1 if a mesh is closed and the corners of its triangles are in counter-clockwise order
/// seen from outside, -1 if it is closed and they are in clockwise order, and 0 if it has a border.
/// In a closed mesh, the triangles pass each edge as often forwards as backwards.
pub(crate) fn outward(vertices: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
    let (mut border, mut volume) = (0u64, 0.0);
    for &[a, b, c] in triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let edge = mixed(u64::from(from.min(to)) << 32 | u64::from(from.max(to)));
            border = match from < to {
                true => border.wrapping_add(edge),
                false => border.wrapping_sub(edge),
            };
        }
        let [a, b, c] = [a, b, c].map(|i| vertices[i as usize]);
        volume += a.dot(b.cross(c));
    }
    if border != 0 || !volume.is_finite() {
        return 0.0;
    }
    if volume == 0.0 { 0.0 } else { volume.signum() }
}

/// Returns a hash of an edge: two different edges have the same hash with a probability of 2^-64
/// (the last steps of SplitMix64: Steele, Lea, Flood: "Fast splittable pseudorandom number
/// generators", OOPSLA 2014).
fn mixed(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [DVec3; 4] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    const OUTWARD: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];

    #[test]
    fn a_tetrahedron_is_closed_until_a_triangle_is_missing_or_turned() {
        assert_eq!(outward(&CORNERS, &OUTWARD), 1.0);
        let inward = OUTWARD.map(|[a, b, c]| [a, c, b]);
        assert_eq!(outward(&CORNERS, &inward), -1.0);
        assert_eq!(outward(&CORNERS, &OUTWARD[..3]), 0.0);
        let [[a, b, c], rest @ ..] = OUTWARD;
        assert_eq!(outward(&CORNERS, &[&[[a, c, b]], &rest[..]].concat()), 0.0);
        assert_eq!(outward(&CORNERS, &[]), 0.0);
    }
}
