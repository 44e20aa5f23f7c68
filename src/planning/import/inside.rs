//! Which points a closed surface encloses.

use glam::DVec3;
use phasmid_geometry::Mesh;

/// Which of some points, by their numbers, lie outside a closed surface: those from which a ray along x
/// passes it an even number of times. Points on the surface are either.
pub(super) fn outside(points: &[DVec3], surface: &Mesh) -> Vec<usize> {
    // Points by their z, so that each triangle meets the few beside it.
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| points[a].z.total_cmp(&points[b].z));
    let mut within = vec![false; points.len()];
    for (number, triangle) in surface.triangles.iter().enumerate() {
        let corners = surface.corners(number);
        let [a, b, c] = corners;
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let first = order.partition_point(|&n| points[n].z < low.z);
        for &n in &order[first..] {
            let p = points[n];
            if p.z > high.z {
                break;
            }
            let beside = low.y <= p.y && p.y <= high.y && p.x < high.x;
            if beside && crosses(corners, *triangle, p) {
                within[n] ^= true;
            }
        }
    }
    (0..points.len()).filter(|&n| !within[n]).collect()
}

/// Whether the ray from a point along x passes a triangle.
fn crosses(corners: [DVec3; 3], indices: [u32; 3], p: DVec3) -> bool {
    let mut inside = false;
    for side in 0..3 {
        let ends = [side, (side + 1) % 3];
        // The same way round for both triangles of an edge, so that no ray slips between them and none
        // passes both.
        let turned = indices[ends[0]] > indices[ends[1]];
        let [u, v] = [usize::from(turned), usize::from(!turned)].map(|end| corners[ends[end]]);
        if (u.z > p.z) != (v.z > p.z) {
            let y = u.y + (v.y - u.y) * (p.z - u.z) / (v.z - u.z);
            inside ^= p.y < y;
        }
    }
    if !inside {
        return false;
    }
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a);
    let along = normal.y * (p.y - a.y) + normal.z * (p.z - a.z);
    // A triangle along the ray is passed nowhere in particular.
    let x = if normal.x == 0.0 {
        (a.x + b.x + c.x) / 3.0
    } else {
        a.x - along / normal.x
    };
    p.x < x
}
