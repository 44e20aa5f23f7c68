//! Lofts a closed mesh through a stack of closed curves.

use crate::Mesh;
use glam::DVec3;

/// Connects `rings` of `points` points each in order, and closes both ends with a fan. Seen from
/// the last ring towards the first, points must run counter-clockwise for outward triangles.
pub(super) fn loft(rings: usize, points: usize, at: impl Fn(usize, usize) -> DVec3) -> Mesh {
    let mut vertices = Vec::with_capacity(rings * points + 2);
    for ring in 0..rings {
        vertices.extend((0..points).map(|k| at(ring, k)));
    }
    let mut triangles = Vec::with_capacity(2 * rings * points);
    let index = |ring: usize, k: usize| (ring * points + k % points) as u32;
    for ring in 0..rings - 1 {
        for k in 0..points {
            let (a, b) = (index(ring, k), index(ring, k + 1));
            let (c, d) = (index(ring + 1, k), index(ring + 1, k + 1));
            // Alternate the diagonals, so that the mesh has no preferred direction.
            if (ring + k).is_multiple_of(2) {
                triangles.extend([[a, b, d], [a, d, c]]);
            } else {
                triangles.extend([[a, b, c], [b, d, c]]);
            }
        }
    }
    for (ring, forwards) in [(0, false), (rings - 1, true)] {
        let hub = vertices.len() as u32;
        let sum: DVec3 = vertices[ring * points..(ring + 1) * points].iter().sum();
        vertices.push(sum / points as f64);
        for k in 0..points {
            let (a, b) = (index(ring, k), index(ring, k + 1));
            triangles.push(if forwards { [a, b, hub] } else { [b, a, hub] });
        }
    }
    Mesh {
        vertices,
        triangles,
        ..Mesh::default()
    }
}

/// Returns the parameters that divide a curve on [0, 1] into `count` pieces of equal length.
pub(super) fn equal_lengths(count: usize, speed: impl Fn(f64) -> f64) -> Vec<f64> {
    const FINE: usize = 4096;
    let mut length = Vec::with_capacity(FINE + 1);
    length.push(0.0);
    for i in 0..FINE {
        let s = speed((i as f64 + 0.5) / FINE as f64);
        length.push(length[i] + s);
    }
    let total = length[FINE];
    let mut at = 0;
    (0..=count)
        .map(|k| {
            let wanted = total * k as f64 / count as f64;
            while at + 1 < FINE && length[at + 1] < wanted {
                at += 1;
            }
            let part = (wanted - length[at]) / (length[at + 1] - length[at]);
            ((at as f64 + part) / FINE as f64).clamp(0.0, 1.0)
        })
        .collect()
}
