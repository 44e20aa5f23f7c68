//! Functions on the sphere: real spherical harmonics, quadratures over directions and along a
//! radius, and a closed mesh of directions.

use glam::DVec3;
use phasmid_core::statistics::gauss_legendre;
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

/// Number of nodes of the quadrature over directions: exact for polynomials up to degree 31, which
/// covers the fourth power of the radius (degree 20) and a smooth displacement.
const NODES: usize = 16;
/// Number of nodes along a radius: exact up to degree 11.
pub(super) const RADIAL: usize = 6;

/// Returns the real spherical harmonics of a degree, orthonormal over the sphere, by order -l to l.
pub(super) fn harmonics(l: usize, n: DVec3) -> Vec<f64> {
    // Associated Legendre functions divided by sin^m, and (x + iy)^m, which contains sin^m, so the
    // poles are not singular.
    let mut values = vec![0.0; 2 * l + 1];
    let (mut cos, mut sin) = (1.0, 0.0);
    for m in 0..=l {
        let mut before = 0.0;
        let mut at: f64 = (1..=m).map(|i| (2 * i - 1) as f64).product();
        for k in m + 1..=l {
            let next =
                ((2 * k - 1) as f64 * n.z * at - (k + m - 1) as f64 * before) / (k - m) as f64;
            (before, at) = (at, next);
        }
        let ratio: f64 = (l - m + 1..=l + m).map(|i| i as f64).product();
        let norm = ((2 * l + 1) as f64 / (4.0 * PI) / ratio).sqrt();
        if m == 0 {
            values[l] = norm * at;
        } else {
            values[l + m] = 2f64.sqrt() * norm * at * cos;
            values[l - m] = 2f64.sqrt() * norm * at * sin;
        }
        (cos, sin) = (n.x * cos - n.y * sin, n.y * cos + n.x * sin);
    }
    values
}

/// Returns directions with their solid angles: Gauss nodes over z, even steps around it.
pub(super) fn directions() -> impl Iterator<Item = (DVec3, f64)> {
    gauss_legendre(NODES).into_iter().flat_map(|(z, w)| {
        let ring = (1.0 - z * z).sqrt();
        (0..2 * NODES).map(move |k| {
            let (sin, cos) = (TAU * (k as f64 + 0.5) / (2 * NODES) as f64).sin_cos();
            (DVec3::new(ring * cos, ring * sin, z), w * PI / NODES as f64)
        })
    })
}

/// Returns an icosahedron with each triangle divided into four `level` times: 20 * 4^level
/// triangles between unit directions, counter-clockwise seen from outside.
pub(super) fn icosphere(level: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (mut directions, mut triangles) = icosahedron();
    for _ in 0..level {
        let mut middles = HashMap::new();
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let mut middle = |a: u32, b: u32| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let sum: DVec3 = directions[a as usize] + directions[b as usize];
                    directions.push(sum.normalize());
                    directions.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    (directions, triangles)
}

/// Corners and triangles of the regular icosahedron.
fn icosahedron() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let g = 0.5 * (1.0 + 5f64.sqrt());
    let corners = [
        (-1.0, g, 0.0),
        (1.0, g, 0.0),
        (-1.0, -g, 0.0),
        (1.0, -g, 0.0),
        (0.0, -1.0, g),
        (0.0, 1.0, g),
        (0.0, -1.0, -g),
        (0.0, 1.0, -g),
        (g, 0.0, -1.0),
        (g, 0.0, 1.0),
        (-g, 0.0, -1.0),
        (-g, 0.0, 1.0),
    ];
    let triangles = [
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    let unit = |(x, y, z)| DVec3::new(x, y, z).normalize();
    (corners.map(unit).to_vec(), triangles.to_vec())
}
